"use strict";
// The few things that the engine asks of WebGL2: programs from shader files, textures, and drawing into them.
(() => {
  const VERTEX = `#version 300 es
void main() {
    gl_Position = vec4(gl_VertexID == 1 ? 3.0 : -1.0, gl_VertexID == 2 ? 3.0 : -1.0, 0.0, 1.0);
}
`;

  rsibr.Gpu = class Gpu {
    constructor(gl) {
      if (!gl) throw new rsibr.Unsupported("This browser has no WebGL2: it may be switched off, or the graphics card too old.");
      this.gl = gl;
      this.reset();
    }

    /** Begin anew, as after a lost context: nothing that was made before is valid. */
    reset() {
      const gl = this.gl;
      if (!gl.getExtension("EXT_color_buffer_float")) {
        throw new rsibr.Unsupported("This graphics card cannot draw into floating-point textures (EXT_color_buffer_float).");
      }
      this.filtersFloat = Boolean(gl.getExtension("OES_texture_float_linear"));
      this.programs = new Map();
      this.foreign = new WeakMap();
      this.textures = new Set();
      this.framebuffer = gl.createFramebuffer();
      this.nothing = gl.createVertexArray();
    }

    /** Program of a fragment shader, one for each set of definitions; `#include <name>` stands for a shader's text. */
    program(name, defines = {}, extra = "") {
      const key = JSON.stringify([name, defines, extra]);
      if (!this.programs.has(key)) this.programs.set(key, this._linked(name, defines, extra));
      return this.programs.get(key);
    }

    _linked(name, defines, extra) {
      const gl = this.gl, source = `#version 300 es\n${rsibr.source(name, defines)}${extra}`;
      const program = gl.createProgram();
      for (const [kind, text] of [[gl.VERTEX_SHADER, VERTEX], [gl.FRAGMENT_SHADER, source]]) {
        const shader = gl.createShader(kind);
        gl.shaderSource(shader, text);
        gl.compileShader(shader);
        gl.attachShader(program, shader);
        if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS) && !gl.isContextLost()) {
          throw new Error(`shader ${name}: ${gl.getShaderInfoLog(shader)}`);
        }
      }
      gl.linkProgram(program);
      if (!gl.getProgramParameter(program, gl.LINK_STATUS) && !gl.isContextLost()) {
        throw new Error(`shader ${name}: ${gl.getProgramInfoLog(program)}`);
      }
      return { program, uniforms: uniforms_of(gl, program) };
    }

    /** Texture of `levels` MIP levels: {texture, target, width, height, layers, format}. */
    texture(width, height, format, { layers = 0, levels = 1, linear = false } = {}) {
      const gl = this.gl, target = layers ? gl.TEXTURE_2D_ARRAY : gl.TEXTURE_2D;
      const texture = gl.createTexture();
      gl.bindTexture(target, texture);
      if (layers) gl.texStorage3D(target, levels, gl[format], width, height, layers);
      else gl.texStorage2D(target, levels, gl[format], width, height);
      const filter = linear ? gl.LINEAR : gl.NEAREST;
      gl.texParameteri(target, gl.TEXTURE_MAG_FILTER, filter);
      gl.texParameteri(target, gl.TEXTURE_MIN_FILTER, levels > 1 ? gl.LINEAR_MIPMAP_LINEAR : filter);
      gl.texParameteri(target, gl.TEXTURE_WRAP_S, gl.CLAMP_TO_EDGE);
      gl.texParameteri(target, gl.TEXTURE_WRAP_T, gl.CLAMP_TO_EDGE);
      const made = { texture, target, width, height, layers, levels, format };
      this.textures.add(made);
      const error = gl.getError();
      if (error !== gl.NO_ERROR && error !== gl.CONTEXT_LOST_WEBGL) {
        this.free(made);
        const size = layers ? `${layers} textures of ${width} × ${height}` : `a texture of ${width} × ${height}`;
        throw new rsibr.Unsupported(`The graphics card has no room for ${size} (error ${error}). Use fewer views or a lower resolution.`);
      }
      return made;
    }

    /** Copy numbers, four a texel (two of integers), into a texture or one of its layers. */
    upload(into, numbers, layer = 0) {
      const gl = this.gl;
      const [format, type] = {
        RGBA16F: [gl.RGBA, gl.HALF_FLOAT], RGBA32F: [gl.RGBA, gl.FLOAT], RG16I: [gl.RG_INTEGER, gl.SHORT],
        RGBA32I: [gl.RGBA_INTEGER, gl.INT],
      }[into.format];
      gl.bindTexture(into.target, into.texture);
      gl.pixelStorei(gl.UNPACK_ALIGNMENT, 1);
      gl.pixelStorei(gl.UNPACK_FLIP_Y_WEBGL, false);
      if (into.layers) {
        gl.texSubImage3D(into.target, 0, 0, 0, layer, into.width, into.height, 1, format, type, numbers);
      } else gl.texSubImage2D(into.target, 0, 0, 0, into.width, into.height, format, type, numbers);
    }

    /** Run a program for every texel of a target, or of a part [x, y, width, height] of it. */
    draw(program, target, values, { part = null, layer = 0 } = {}) {
      const gl = this.gl;
      this._to(target, layer);
      const [x, y, width, height] = part || [0, 0, target.width, target.height];
      gl.viewport(x, y, width, height);
      for (const test of [gl.BLEND, gl.DEPTH_TEST, gl.CULL_FACE, gl.SCISSOR_TEST, gl.STENCIL_TEST]) gl.disable(test);
      gl.colorMask(true, true, true, true);
      gl.useProgram(program.program);
      this.set(program, values);
      gl.bindVertexArray(this.nothing);
      gl.drawArrays(gl.TRIANGLES, 0, 3);
    }

    /** Uniforms of a page's own program, for `set`. */
    described(program) {
      if (!this.foreign.has(program)) this.foreign.set(program, { program, uniforms: uniforms_of(this.gl, program) });
      return this.foreign.get(program);
    }

    /** Set uniforms by name; those that a program does not have are passed over. A texture takes the next unit. Returns
     *  the next free one. */
    set(program, values, firstUnit = 0) {
      const gl = this.gl;
      let unit = firstUnit;
      for (const [name, value] of Object.entries(values)) {
        const uniform = program.uniforms[name];
        if (!uniform) continue;
        if (value.texture) {
          gl.activeTexture(gl.TEXTURE0 + unit);
          gl.bindTexture(value.target, value.texture);
          gl.uniform1i(uniform.location, unit++);
        } else uniform.set(value);
      }
      gl.activeTexture(gl.TEXTURE0);
      return unit;
    }

    /** Copy what was drawn into the target, from its lower left corner, to a place of another texture. */
    copy(from, into, [x, y, width, height]) {
      const gl = this.gl;
      this._to(from, 0);
      gl.bindTexture(into.target, into.texture);
      gl.copyTexSubImage2D(into.target, 0, x, y, 0, 0, width, height);
    }

    /** Red, green and blue of all texels, row by row. */
    read(from) {
      const gl = this.gl, pixels = new Float32Array(4 * from.width * from.height);
      this._to(from, 0);
      gl.pixelStorei(gl.PACK_ALIGNMENT, 1);
      gl.readPixels(0, 0, from.width, from.height, gl.RGBA, gl.FLOAT, pixels);
      this.done();
      const colours = new Float32Array(3 * from.width * from.height);
      for (let i = 0, at = 0; i < pixels.length; i += 4) {
        for (let k = 0; k < 3; k++) colours[at++] = pixels[i + k];
      }
      return colours;
    }

    makeLevels(of) {
      this.gl.bindTexture(of.target, of.texture);
      this.gl.generateMipmap(of.target);
    }

    /** Leave the page's own canvas bound, as a page expects it. */
    done() {
      const gl = this.gl;
      gl.bindFramebuffer(gl.FRAMEBUFFER, null);
      gl.bindVertexArray(null);
      gl.viewport(0, 0, gl.drawingBufferWidth, gl.drawingBufferHeight);
    }

    free(...textures) {
      for (const one of textures) {
        if (!one || !this.textures.delete(one)) continue;
        this.gl.deleteTexture(one.texture);
      }
    }

    release() {
      this.free(...this.textures);
      for (const { program } of this.programs.values()) this.gl.deleteProgram(program);
      this.programs.clear();
      this.gl.deleteFramebuffer(this.framebuffer);
      this.gl.deleteVertexArray(this.nothing);
    }

    _to(target, layer) {
      const gl = this.gl;
      gl.bindFramebuffer(gl.FRAMEBUFFER, this.framebuffer);
      if (target.layers) {
        gl.framebufferTextureLayer(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, target.texture, 0, layer);
      } else {
        gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.TEXTURE_2D, target.texture, 0);
      }
    }
  };

  /** Text of a shader with its precisions and definitions, to stand after `#version 300 es`. */
  rsibr.source = function source(name, defines) {
    const kinds = ["float", "int", "sampler2D", "sampler2DArray", "isampler2D"];
    const head = kinds.map((kind) => `precision highp ${kind};\n`).join("");
    return head + Object.entries(defines).map(([key, value]) => `#define ${key} ${value}\n`).join("") + rsibr.glsl(name);
  };

  /** Text of a shader with what it includes; what is included twice counts once. */
  rsibr.glsl = function glsl(name) {
    if (!(name in rsibr.shaders)) throw new Error(`there is no shader '${name}'`);
    const text = rsibr.shaders[name].replace(/^#include <(\w+)>$/gm, (_, other) => glsl(other));
    return `#ifndef FILE_${name}\n#define FILE_${name}\n${text}#endif\n`;
  };

  function uniforms_of(gl, program) {
    const found = {};
    for (let k = 0; k < gl.getProgramParameter(program, gl.ACTIVE_UNIFORMS); k++) {
      const { name, type, size } = gl.getActiveUniform(program, k);
      const location = gl.getUniformLocation(program, name);
      found[name.replace("[0]", "")] = { location, set: setter(gl, type, size, location) };
    }
    return found;
  }

  function setter(gl, type, size, location) {
    const numbers = (value) => (value.length === undefined ? [value] : value);
    switch (type) {
      case gl.FLOAT: return (value) => gl.uniform1fv(location, numbers(value));
      case gl.FLOAT_VEC2: return (value) => gl.uniform2fv(location, value);
      case gl.FLOAT_VEC3: return (value) => gl.uniform3fv(location, value);
      case gl.FLOAT_VEC4: return (value) => gl.uniform4fv(location, value);
      case gl.FLOAT_MAT3: return (value) => gl.uniformMatrix3fv(location, false, value);
      case gl.INT: case gl.BOOL: return (value) => gl.uniform1iv(location, numbers(value));
      case gl.INT_VEC2: return (value) => gl.uniform2iv(location, value);
      case gl.INT_VEC3: return (value) => gl.uniform3iv(location, value);
      case gl.INT_VEC4: return (value) => gl.uniform4iv(location, value);
      default: return () => { throw new Error(`a uniform of type ${type}`); };
    }
  }
})();
