// A whole map by `miller1984`.
#include <constants>
#include <miller1984>
#include <shading_map>
