// A whole map by `kautz2003`.
#include <constants>
#include <kautz2003>
#include <shading_map>
