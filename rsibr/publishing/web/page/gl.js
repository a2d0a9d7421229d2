"use strict";
/* What every part of the page needs of WebGL2: programs, textures. */
var rsibr = globalThis.rsibr || (globalThis.rsibr = {});

rsibr.gl = {
  program(gl, vertex, fragment) {
    const program = gl.createProgram();
    for (const [kind, text] of [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]]) {
      const shader = gl.createShader(kind);
      gl.shaderSource(shader, `#version 300 es\nprecision highp float;\nprecision highp int;\nprecision highp sampler2D;\n${text}`);
      gl.compileShader(shader);
      gl.attachShader(program, shader);
      if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS) && !gl.isContextLost()) {
        throw new Error(`shader: ${gl.getShaderInfoLog(shader)}`);
      }
    }
    gl.linkProgram(program);
    if (!gl.getProgramParameter(program, gl.LINK_STATUS) && !gl.isContextLost()) {
      throw new Error(`program: ${gl.getProgramInfoLog(program)}`);
    }
    return program;
  },

  texture(gl, filter, width, height, internal, format, type, data) {
    const texture = gl.createTexture();
    gl.bindTexture(gl.TEXTURE_2D, texture);
    gl.pixelStorei(gl.UNPACK_ALIGNMENT, 1);
    gl.pixelStorei(gl.UNPACK_FLIP_Y_WEBGL, false);
    gl.texImage2D(gl.TEXTURE_2D, 0, internal, width, height, 0, format, type, data);
    for (const side of [gl.TEXTURE_WRAP_S, gl.TEXTURE_WRAP_T]) gl.texParameteri(gl.TEXTURE_2D, side, gl.CLAMP_TO_EDGE);
    for (const side of [gl.TEXTURE_MIN_FILTER, gl.TEXTURE_MAG_FILTER]) gl.texParameteri(gl.TEXTURE_2D, side, filter);
    return texture;
  },

  /** Set the uniforms of the page that the program has, `pageEye` as eye: names apart from those of the engine. Vectors
      go by their length, matrices are of 9 or 16 numbers. */
  uniforms(gl, program, values) {
    for (const [name, value] of Object.entries(values)) {
      const at = gl.getUniformLocation(program, `page${name[0].toUpperCase()}${name.slice(1)}`);
      if (at === null) continue;
      if (typeof value === "number") gl.uniform1f(at, value);
      else if (value.integer !== undefined) gl.uniform1i(at, value.integer);
      else if (value.length === 16) gl.uniformMatrix4fv(at, false, value);
      else if (value.length === 9) gl.uniformMatrix3fv(at, false, value);
      else gl[`uniform${value.length}fv`](at, value);
    }
  },
};
