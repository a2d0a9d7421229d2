// Tables by the cosine of the surface angle, a row each, nodes evenly spaced in its root; see rsibr/methods/cosine_table.py.
uniform sampler2D tables;

// Row `row`, whose last node is `last`, at a cosine
vec4 byCosine(int row, int last, float cosine) {
    float place = sqrt(clamp(cosine, 0.0, 1.0)) * float(last);
    int below = min(int(place), last - 1);
    return mix(texelFetch(tables, ivec2(below, row), 0), texelFetch(tables, ivec2(below + 1, row), 0), place - float(below));
}
