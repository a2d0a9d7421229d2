"use strict";
/** Delta lights of a bundle's array (lights, 2, 3): {count, directions, irradiance}, a triple a light. */
rsibr.deltaLights = function deltaLights({ data, shape }) {
  const triples = (row) =>
    Array.from({ length: shape[0] }, (_, k) => Array.from(data.subarray(6 * k + 3 * row, 6 * k + 3 * row + 3)));
  return { count: shape[0], directions: triples(0), irradiance: triples(1) };
};
