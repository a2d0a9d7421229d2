"use strict";
/* The object: triangles of several surface types, each with the maps of its own bake. */
var rsibr = globalThis.rsibr || (globalThis.rsibr = {});

rsibr.meshVertexGlsl = `
uniform mat4 pageClip;
uniform vec3 pageLowest, pageExtent;      // of the bounding box; positions are stored as shares of it
layout(location = 0) in vec3 place;
layout(location = 1) in vec3 normal;
out vec3 pagePosition, pageInterpolated;
void main() {
  pagePosition = pageLowest + pageExtent * (place * 0.5 + 0.5);
  pageInterpolated = normal;
  gl_Position = pageClip * vec4(pagePosition, 1.0);
}
`;

const MESH_INPUTS = `
in vec3 pagePosition, pageInterpolated;
out vec4 pageResult;
uniform vec3 pageEye, pageBack;
uniform float pageParallel;
vec3 pageToViewer() { return pageParallel > 0.5 ? pageBack : normalize(pageEye - pagePosition); }
vec3 pageFaceNormal() { return normalize(cross(dFdx(pagePosition), dFdy(pagePosition))); }
`;

rsibr.meshFragmentGlsl = (lookup) => `
${lookup}${rsibr.toneGlsl}${MESH_INPUTS}${rsibr.safeNormalGlsl}
void main() {
  vec3 v = pageToViewer();
  pageResult = pageShown(pageRadianceAt(pageSafeNormal(pageInterpolated, pageFaceNormal(), v), v), 1.0);
}
`;

/** Shapes without a bake: grey, so that they are not taken for rendered. */
rsibr.unbakedFragmentGlsl = () => `
${MESH_INPUTS}${rsibr.safeNormalGlsl}
void main() {
  vec3 v = pageToViewer();
  pageResult = vec4(vec3(0.10 + 0.16 * dot(pageSafeNormal(pageInterpolated, pageFaceNormal(), v), v)), 1.0);
}
`;

/** Typed arrays of the mesh as the page holds it: differences of indices summed, positions and normals interleaved. */
rsibr.meshArrays = function (stored) {
  const [positions, normals, faces] = ["positions", "normals", "faces"].map((name) => stored[name].data);
  const count = positions.length / 3, vertices = new Int16Array(8 * count), indices = new Uint32Array(faces.length);
  for (let k = 0; k < count; k++) {
    for (let axis = 0; axis < 3; axis++) {
      vertices[8 * k + axis] = positions[axis * count + k];
      vertices[8 * k + 4 + axis] = normals[axis * count + k];
    }
  }
  let index = 0;
  for (let k = 0; k < faces.length; k++) indices[k] = index = (index + faces[k]) >>> 0;
  return { vertices, indices };
};

rsibr.Mesh = class {
  /** @param meta {{lowest, extent, parts: {bake: number, first: number, count: number}[]}} */
  constructor(gl, meta, { vertices, indices }) {
    this.gl = gl;
    this.meta = meta;
    this.array = gl.createVertexArray();
    gl.bindVertexArray(this.array);
    gl.bindBuffer(gl.ARRAY_BUFFER, gl.createBuffer());
    gl.bufferData(gl.ARRAY_BUFFER, vertices, gl.STATIC_DRAW);
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, gl.createBuffer());
    gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, indices, gl.STATIC_DRAW);
    for (const [location, offset] of [[0, 0], [1, 8]]) {
      gl.enableVertexAttribArray(location);
      gl.vertexAttribPointer(location, 3, gl.SHORT, true, 16, offset);
    }
    gl.bindVertexArray(null);
  }

  static bytes({ vertices, indices }) {
    return vertices.byteLength + indices.byteLength;
  }

  /** Draw the triangles of one bake; −1: those without. */
  draw(bake) {
    const gl = this.gl;
    gl.bindVertexArray(this.array);
    for (const part of this.meta.parts) {
      if (part.bake === bake) gl.drawElements(gl.TRIANGLES, part.count, gl.UNSIGNED_INT, 4 * part.first);
    }
    gl.bindVertexArray(null);
  }
};
