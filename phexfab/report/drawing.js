// What a scene looks like on a canvas: its parts on the graphics card, their colours, light and shadow.
// Lengths are counted in the scene's radius from its middle; angles in degrees.
const RAD = Math.PI / 180;
const OPENING = 26, SLOPE = Math.tan(OPENING * RAD / 2);
const clamp = (x, low, high) => Math.min(Math.max(x, low), high);
const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const unit = (a) => a.map((c) => c / (Math.hypot(...a) || 1));
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const calm = matchMedia("(prefers-reduced-motion: reduce)");
const FINE = 2;  // twice as fine as the page: thin joints stay lines
const HIDDEN = 0, CHOSEN = 102, BESIDE = 178, PLAIN = 255;  // the fourth number of a part's state

function axesOf({ azimuth, elevation }) {
  const [ca, sa, ce, se] = [Math.cos(azimuth * RAD), Math.sin(azimuth * RAD), Math.cos(elevation * RAD), Math.sin(elevation * RAD)];
  return { right: [-sa, ca, 0], up: [-se * ca, -se * sa, ce], back: [ce * ca, ce * sa, se] };
}

class Drawing {
  build() {
    const { gl, scene } = this, layers = [...scene.layers, ...(scene.haze ? [scene.haze] : [])];
    const total = (key) => layers.reduce((n, layer) => n + layer[key].length, 0);
    const points = this.points = new Float32Array(total("positions")), count = points.length / 3;
    const owner = this.owner = new Uint32Array(count), shift = this.shift = new Float32Array(points.length);
    const triangles = new Uint32Array(total("triangles")), lines = new Uint32Array(total("lines"));
    const { low, span, middle, radius } = scene;
    this.marks = layers.flatMap((layer) => layer.marks);
    this.index = new Map(this.marks.map((mark, k) => [mark, k]));
    this.states = new Uint8Array(4096 * Math.ceil(this.marks.length / 1024));
    this.group = new Uint8Array(this.marks.length);
    this.axis = new Float32Array(3 * this.marks.length);
    this.centre = new Float32Array(3 * this.marks.length);
    this.away = new Float32Array(3 * this.marks.length);  // how far a part moves when all is exploded
    this.shown = scene.groups.map(() => true);
    let part = 0, v = 0, t = 0, l = 0;
    for (const layer of layers) {
      if (layer === scene.haze) this.hazeAt = t;
      let from = 0, edge = 0;
      for (let i = 0; i < layer.positions.length; i++)
        points[3 * v + i] = (low[i % 3] + layer.positions[i] / 65535 * span[i % 3] - middle[i % 3]) / radius;
      for (let k = 0; k < layer.marks.length; k++, part++) {
        const size = layer.vertices[k];
        this.states.set([...layer.colours.subarray(3 * k, 3 * k + 3), PLAIN], 4 * part);
        this.group[part] = layer.groups?.[k] ?? 0;
        for (let i = 0; i < 3 * layer.triangle_counts[k]; i++) triangles[t++] = v + layer.triangles[from++];
        for (let i = 0; i < 2 * layer.line_counts[k]; i++) lines[l++] = v + layer.lines[edge++];
        for (let c = 0; c < 3; c++) {
          let sum = 0;
          for (let i = v; i < v + size; i++) sum += points[3 * i + c];
          const middle = this.centre[3 * part + c] = sum / size;
          const axis = this.axis[3 * part + c] = layer.axes ? (layer.axes[3 * k + c] - 127) / 127 : 0;
          const away = this.away[3 * part + c] = 0.55 * middle + (layer.lift ?? 0) * axis;
          for (let i = v; i < v + size; i++) shift[3 * i + c] = away;
        }
        owner.fill(part, v, v += size);
      }
    }
    this.colours = this.states.slice();
    this.count = this.hazeAt ?? t; this.total = t; this.lineCount = l;

    const compile = (kind, text) => {
      const shader = gl.createShader(kind);
      gl.shaderSource(shader, text); gl.compileShader(shader);
      if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS)) throw new Error(gl.getShaderInfoLog(shader));
      return shader;
    };
    const program = gl.createProgram();
    gl.attachShader(program, compile(gl.VERTEX_SHADER, VERTEX));
    gl.attachShader(program, compile(gl.FRAGMENT_SHADER, FRAGMENT));
    ["place", "part", "shift"].forEach((name, k) => gl.bindAttribLocation(program, k, name));
    gl.linkProgram(program); gl.useProgram(program);
    this.at = new Proxy({}, { get: (known, key) => known[key] ??= gl.getUniformLocation(program, key) });
    const buffer = (kind, array) => {
      const made = gl.createBuffer();
      gl.bindBuffer(kind, made); gl.bufferData(kind, array, gl.STATIC_DRAW);
      return made;
    };
    const [atPoints, atOwner, atShift] = [points, owner, shift].map((array) => buffer(gl.ARRAY_BUFFER, array));
    const bind = (elements) => {
      const vao = gl.createVertexArray();
      gl.bindVertexArray(vao); buffer(gl.ELEMENT_ARRAY_BUFFER, elements);
      gl.bindBuffer(gl.ARRAY_BUFFER, atPoints); gl.enableVertexAttribArray(0); gl.vertexAttribPointer(0, 3, gl.FLOAT, false, 0, 0);
      gl.bindBuffer(gl.ARRAY_BUFFER, atOwner); gl.enableVertexAttribArray(1); gl.vertexAttribIPointer(1, 1, gl.UNSIGNED_INT, 0, 0);
      gl.bindBuffer(gl.ARRAY_BUFFER, atShift); gl.enableVertexAttribArray(2); gl.vertexAttribPointer(2, 3, gl.FLOAT, false, 0, 0);
      return vao;
    };
    this.faces = bind(triangles); this.edges = bind(lines);
    const texture = (place, filter, more) => {
      gl.activeTexture(gl.TEXTURE0 + place); gl.bindTexture(gl.TEXTURE_2D, gl.createTexture());
      gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MIN_FILTER, filter); gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MAG_FILTER, filter);
      more?.();
    };
    texture(1, gl.LINEAR, () => {
      gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_COMPARE_MODE, gl.COMPARE_REF_TO_TEXTURE);
      gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_WRAP_S, gl.CLAMP_TO_EDGE); gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_WRAP_T, gl.CLAMP_TO_EDGE);
      gl.texImage2D(gl.TEXTURE_2D, 0, gl.DEPTH_COMPONENT24, 2048, 2048, 0, gl.DEPTH_COMPONENT, gl.UNSIGNED_INT, null);
      this.shadow = gl.createFramebuffer();
      gl.bindFramebuffer(gl.FRAMEBUFFER, this.shadow);
      gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.DEPTH_ATTACHMENT, gl.TEXTURE_2D, gl.getParameter(gl.TEXTURE_BINDING_2D), 0);
      gl.bindFramebuffer(gl.FRAMEBUFFER, null);
    });
    texture(0, gl.NEAREST);
    gl.uniform1i(this.at.states, 0); gl.uniform1i(this.at.shade, 1);
    // The sun stands still in the world, high over the left shoulder of who looks from home.
    const { right, up, back } = axesOf(this.home);
    this.sun = unit([0, 1, 2].map((k) => -0.55 * right[k] + 0.25 * up[k] + 0.45 * back[k] + (k === 2 ? 0.62 : 0)));
    gl.uniform3fv(this.at.sun, this.sun); gl.uniform1i(this.at.shaded, scene.ground ? 1 : 0);
    gl.enable(gl.DEPTH_TEST); gl.depthFunc(gl.LEQUAL);
    gl.blendFuncSeparate(gl.SRC_ALPHA, gl.ONE_MINUS_SRC_ALPHA, gl.ONE, gl.ONE_MINUS_SRC_ALPHA);
    this.pick = gl.createFramebuffer(); this.pickColour = gl.createRenderbuffer(); this.pickDepth = gl.createRenderbuffer();
    this.mark([], []);
  }

  // --- what the parts look like ---

  mark(chosen, beside) {
    const numbers = (marks) => new Set(marks.map((mark) => this.index.get(mark)));
    const first = numbers(chosen), second = numbers(beside), { gl, states } = this;
    for (let k = 0; k < this.marks.length; k++)
      states[4 * k + 3] = !this.shown[this.group[k]] ? HIDDEN : first.has(k) ? CHOSEN : second.has(k) ? BESIDE : PLAIN;
    const hidden = this.shown.join();  // shadows change with what is hidden, not with what is chosen
    this.stale ||= hidden !== this.hidden; this.hidden = hidden; this.chosen = first;
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA8, 1024, states.length / 4096, 0, gl.RGBA, gl.UNSIGNED_BYTE, states);
    this.refresh();
  }

  paint(places, ramp, neutral) {  // places: mark -> 0…254 along the ramp, 255 for no value; null: as made
    const stops = [...ramp, neutral].map((c) => [1, 3, 5].map((k) => parseInt(c.slice(k, k + 2), 16))), last = ramp.length - 1;
    this.marks.forEach((mark, k) => {
      const place = places?.get(mark), x = place / 254 * last, i = Math.min(Math.floor(x), last - 1);
      const colour = place === undefined ? this.colours.subarray(4 * k, 4 * k + 3)
        : place === 255 ? stops[last + 1] : stops[i].map((c, j) => Math.round(c + (x - i) * (stops[i + 1][j] - c)));
      this.states.set(colour, 4 * k);
    });
    const names = [...this.chosen].map((k) => this.marks[k]);
    this.mark(names, []);
  }

  middle(k) { return [0, 1, 2].map((c) => this.centre[3 * k + c] + this.explode * this.away[3 * k + c]); }

  // --- drawing ---

  prepare() {
    const { gl, canvas, ratio } = this;
    const width = Math.max(1, Math.round(canvas.clientWidth * ratio)), height = Math.max(1, Math.round(canvas.clientHeight * ratio));
    if (canvas.width !== width || canvas.height !== height) { canvas.width = width; canvas.height = height; }
    const { columns, eye } = this.camera();
    gl.viewport(0, 0, width, height);
    gl.uniformMatrix4fv(this.at.camera, false, columns);
    gl.uniform3fv(this.at.eye, eye); gl.uniform1f(this.at.explode, this.explode);
    gl.uniform1ui(this.at.hot, this.hot ?? 0xffffffff);
    gl.uniform1f(this.at.dark, matchMedia("(prefers-color-scheme: dark)").matches ? 1 : 0);
    return eye;
  }

  castShadows() {  // once for every change of what stands where
    if (!this.stale || !this.scene.ground) return;
    this.stale = false;
    const { gl, sun } = this, across = unit(cross([0, 0, 1], sun)), along = cross(sun, across), size = 1.05 * this.reach;
    this.light = [0, 1, 2].flatMap((k) => [across[k] / size, along[k] / size, -sun[k] / (2 * size), 0]).concat([0, 0, 0, 1]);
    this.ground = Infinity;
    for (let v = 0; v < this.owner.length; v++)
      if (this.states[4 * this.owner[v] + 3]) this.ground = Math.min(this.ground, this.points[3 * v + 2] + this.explode * this.shift[3 * v + 2]);
    gl.activeTexture(gl.TEXTURE1); const map = gl.getParameter(gl.TEXTURE_BINDING_2D); gl.bindTexture(gl.TEXTURE_2D, null); gl.activeTexture(gl.TEXTURE0);
    gl.bindFramebuffer(gl.FRAMEBUFFER, this.shadow); gl.viewport(0, 0, 2048, 2048);
    gl.clear(gl.DEPTH_BUFFER_BIT);
    gl.uniformMatrix4fv(this.at.camera, false, this.light); gl.uniformMatrix4fv(this.at.light, false, this.light);
    gl.uniform1f(this.at.explode, this.explode);
    this.solid(5);
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
    gl.activeTexture(gl.TEXTURE1); gl.bindTexture(gl.TEXTURE_2D, map); gl.activeTexture(gl.TEXTURE0);
  }

  solid(mode, from = 0, to = this.count) {
    const { gl } = this;
    gl.uniform1i(this.at.mode, mode); gl.uniform1f(this.at.lift, 0);
    gl.bindVertexArray(this.faces);
    gl.drawElements(gl.TRIANGLES, to - from, gl.UNSIGNED_INT, 4 * from);
  }

  wire() {
    const { gl } = this;
    gl.uniform1i(this.at.mode, 1); gl.uniform1f(this.at.lift, 2e-4);
    gl.enable(gl.BLEND); gl.bindVertexArray(this.edges);
    gl.drawElements(gl.LINES, this.lineCount, gl.UNSIGNED_INT, 0);
    gl.disable(gl.BLEND);
  }

  draw() {
    const { gl } = this;
    this.castShadows();
    const eye = this.prepare();
    gl.clearColor(0, 0, 0, 0); gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    if (this.hazeAt !== undefined) {  // from far to near: S behind, the sphere as a haze, S in front
      gl.enable(gl.CULL_FACE); gl.cullFace(gl.FRONT); this.solid(0); gl.cullFace(gl.BACK);
      gl.enable(gl.BLEND); gl.disable(gl.DEPTH_TEST);
      this.solid(3, this.hazeAt, this.total);
      gl.disable(gl.BLEND); gl.enable(gl.DEPTH_TEST); gl.clear(gl.DEPTH_BUFFER_BIT);
      this.solid(0); gl.disable(gl.CULL_FACE);
      // The sphere's far side must not show the edges behind it.
      gl.colorMask(false, false, false, false);
      gl.enable(gl.CULL_FACE); gl.cullFace(gl.FRONT); this.solid(3, this.hazeAt, this.total);
      gl.disable(gl.CULL_FACE); gl.colorMask(true, true, true, true);
    } else this.solid(0);
    this.wire();
    if (this.scene.ground && eye[2] > this.ground && isFinite(this.ground)) {
      gl.uniform1i(this.at.mode, 6); gl.uniform1f(this.at.ground, this.ground - 0.004); gl.bindVertexArray(this.faces);
      gl.enable(gl.BLEND); gl.depthMask(false); gl.drawArrays(gl.TRIANGLE_STRIP, 0, 4); gl.depthMask(true); gl.disable(gl.BLEND);
    }
    if (this.chosen.size) {  // what is chosen shines through what stands before it
      gl.disable(gl.DEPTH_TEST); gl.enable(gl.BLEND); this.solid(4); gl.disable(gl.BLEND); gl.enable(gl.DEPTH_TEST);
    }
    this.frames = (this.frames ?? 0) + 1;
  }

  find(event, slack = 2) {  // the part nearest the pointer: a few pixels of a picture of part numbers
    const { gl, canvas } = this;
    this.prepare();
    gl.bindFramebuffer(gl.FRAMEBUFFER, this.pick);
    if (this.pickSize !== `${canvas.width} ${canvas.height}`) {
      for (const [buffer, kind, place] of [[this.pickColour, gl.RGBA8, gl.COLOR_ATTACHMENT0], [this.pickDepth, gl.DEPTH_COMPONENT24, gl.DEPTH_ATTACHMENT]]) {
        gl.bindRenderbuffer(gl.RENDERBUFFER, buffer);
        gl.renderbufferStorage(gl.RENDERBUFFER, kind, canvas.width, canvas.height);
        gl.framebufferRenderbuffer(gl.FRAMEBUFFER, place, gl.RENDERBUFFER, buffer);
      }
      this.pickSize = `${canvas.width} ${canvas.height}`;
    }
    const box = canvas.getBoundingClientRect(), ratio = canvas.width / box.width, r = Math.round(slack * ratio), side = 2 * r + 1;
    const x = Math.floor((event.clientX - box.left) * ratio) - r, y = canvas.height - 1 - Math.floor((event.clientY - box.top) * ratio) - r;
    gl.enable(gl.SCISSOR_TEST); gl.scissor(x, y, side, side);
    gl.clearColor(0, 0, 0, 0); gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    this.solid(2);
    const pixels = new Uint8Array(4 * side * side);
    gl.readPixels(x, y, side, side, gl.RGBA, gl.UNSIGNED_BYTE, pixels);
    gl.disable(gl.SCISSOR_TEST); gl.bindFramebuffer(gl.FRAMEBUFFER, null);
    let best, nearest = Infinity;
    for (let k = 0; k < side * side; k++) {
      const part = pixels[4 * k] + (pixels[4 * k + 1] << 8) + (pixels[4 * k + 2] << 16) - 1, off = Math.hypot(k % side - r, Math.floor(k / side) - r);
      if (part >= 0 && off < nearest) { best = part; nearest = off; }
    }
    return best;
  }
}
