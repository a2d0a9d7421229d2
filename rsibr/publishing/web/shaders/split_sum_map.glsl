// A whole map by `split-sum`.
#include <constants>
#include <split_sum>
#include <shading_map>
