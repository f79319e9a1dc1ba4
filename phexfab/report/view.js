// The page's 3-D view: orbit, zoom, pan; pointing at a part names it everywhere on the page.
// Without WebGL 2 nothing here runs to an end, and the pictures underneath stay.
"use strict";
(() => {
  const data = JSON.parse(document.getElementById("report-data").textContent);
  const TYPES = { u1: Uint8Array, u2: Uint16Array, u4: Uint32Array };
  const decode = ({ type, data }) => {
    const text = atob(data), bytes = new Uint8Array(text.length);
    for (let i = 0; i < text.length; i++) bytes[i] = text.charCodeAt(i);
    return new TYPES[type](bytes.buffer);
  };

  const VERTEX = `#version 300 es
    in vec3 place; in uint part;
    uniform mat4 camera; uniform vec3 low, span, middle; uniform float radius, lift; uniform highp int mode;
    uniform highp sampler2D states;
    flat out vec4 tint; flat out uint who; out vec3 at;
    void main() {
      tint = texelFetch(states, ivec2(part & 1023u, part >> 10), 0);
      who = part;
      at = (low + span * place - middle) / radius;
      gl_Position = tint.a < 0.5 || (mode == 4 && tint.a > 0.75) ? vec4(0, 0, 2, 1) : camera * vec4(at, 1);
      gl_Position.z -= lift * gl_Position.w;
    }`;
  const FRAGMENT = `#version 300 es
    precision highp float; precision highp int;
    flat in vec4 tint; flat in uint who; in vec3 at;
    uniform vec3 eye, sun; uniform highp int mode; uniform uint hot; uniform bool marked;
    out vec4 colour;
    void main() {
      if (mode == 2) {  // for pointing: the part's number, one up
        uint n = who + 1u;
        colour = vec4(n & 255u, (n >> 8) & 255u, (n >> 16) & 255u, 255u) / 255.0;
        return;
      }
      if (mode == 4) { colour = vec4(0.99, 0.68, 0.05, 0.5); return; }
      bool chosen = marked && tint.a < 0.75;
      if (mode == 1) { colour = vec4(0.07, 0.10, 0.14, chosen ? 0.9 : 0.5); return; }
      vec3 back = normalize(eye - at);
      if (mode == 3) {  // the sphere: a haze, denser towards its rim
        float rim = 1.0 - abs(dot(normalize(at), back));
        colour = vec4(tint.rgb, 0.50 + 0.35 * rim);
        return;
      }
      vec3 n = normalize(cross(dFdx(at), dFdy(at)));
      if (dot(n, back) < 0.0) n = -n;
      float light = 0.52 + 0.22 * (0.5 + 0.5 * n.z) + 0.30 * max(dot(n, sun), 0.0)
                  + 0.14 * dot(n, back);
      vec3 base = chosen || who == hot ? mix(tint.rgb, vec3(0.99, 0.72, 0.10), 0.85) : tint.rgb;
      colour = vec4(min(base * light, 1.0), 1);
    }`;

  const views = [];
  const drawn = new Map();  // mark -> its elements in the sheets
  for (const node of document.querySelectorAll("svg [data-mark]")) {
    if (!drawn.has(node.dataset.mark)) drawn.set(node.dataset.mark, []);
    drawn.get(node.dataset.mark).push(node);
  }
  let pinned = "", shown = [];
  function show(mark) {
    for (const one of shown) for (const node of drawn.get(one) ?? []) node.classList.remove("hot");
    shown = mark ? mark.split(", ").flatMap((one) => data.also[one] ?? [one]) : [];
    for (const one of shown) for (const node of drawn.get(one) ?? []) node.classList.add("hot");
    for (const view of views) view.mark(shown);
  }
  const pin = (mark) => { pinned = mark === pinned ? "" : mark; show(pinned); };

  class View {
    constructor(figure, scene, pose) {
      this.figure = figure; this.scene = scene; this.pose = pose;
      this.canvas = document.createElement("canvas");
      this.canvas.tabIndex = 0;
      this.canvas.setAttribute("role", "img");
      this.canvas.setAttribute("aria-label", figure.querySelector("img").alt + ". Arrow keys turn, + and − zoom.");
      const gl = this.gl = this.canvas.getContext("webgl2", { antialias: true, alpha: true });
      if (!gl) throw new Error("no WebGL 2");
      this.build();
      figure.querySelector(".frame").append(this.canvas);
      this.tip = document.createElement("output");
      figure.querySelector(".frame").append(this.tip);
      figure.classList.add("live");
      Object.assign(this, { zoom: 1, x: 0, y: 0 });
      this.fit();
      this.listen();
      this.toggles();
      new ResizeObserver(() => this.refresh()).observe(this.canvas);
    }

    build() {
      const { gl, scene } = this, layers = [...scene.layers, ...(scene.haze ? [scene.haze] : [])];
      const parts = layers.map((l) => ({ ...l, positions: decode(l.positions), vertices: decode(l.vertices),
        triangles: decode(l.triangles), triangleCounts: decode(l.triangle_counts),
        lines: decode(l.lines), lineCounts: decode(l.line_counts), colours: decode(l.colours) }));
      const sum = (key) => parts.reduce((n, l) => n + l[key].length, 0);
      const places = new Uint16Array(sum("positions")), owner = new Uint32Array(places.length / 3);
      const triangles = new Uint32Array(sum("triangles")), lines = new Uint32Array(sum("lines"));
      this.marks = []; this.families = []; let v = 0, t = 0, l = 0;
      this.states = new Uint8Array(4096 * Math.ceil(parts.reduce((n, p) => n + p.marks.length, 0) / 1024));
      for (const layer of parts) {
        const first = this.marks.length;
        if (layer === parts.at(-1) && scene.haze) this.hazeAt = t;
        places.set(layer.positions, 3 * v);
        let from = 0, edge = 0;
        layer.marks.forEach((mark, k) => {
          this.states.set([...layer.colours.subarray(3 * k, 3 * k + 3), 255], 4 * (first + k));
          for (let i = 0; i < 3 * layer.triangleCounts[k]; i++) triangles[t++] = v + layer.triangles[from++];
          for (let i = 0; i < 2 * layer.lineCounts[k]; i++) lines[l++] = v + layer.lines[edge++];
          owner.fill(first + k, v, v += layer.vertices[k]);
        });
        this.marks.push(...layer.marks);
        this.families.push({ name: layer.family, first, last: this.marks.length, on: true });
      }
      this.places = places;
      this.count = this.hazeAt ?? t; this.total = t; this.lineCount = l;
      this.index = new Map(this.marks.map((mark, k) => [mark, k]));

      const compile = (kind, text) => {
        const shader = gl.createShader(kind);
        gl.shaderSource(shader, text); gl.compileShader(shader);
        if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS)) throw new Error(gl.getShaderInfoLog(shader));
        return shader;
      };
      const program = gl.createProgram();
      gl.attachShader(program, compile(gl.VERTEX_SHADER, VERTEX));
      gl.attachShader(program, compile(gl.FRAGMENT_SHADER, FRAGMENT));
      gl.bindAttribLocation(program, 0, "place"); gl.bindAttribLocation(program, 1, "part");
      gl.linkProgram(program); gl.useProgram(program);
      this.at = new Proxy({}, { get: (cache, key) => cache[key] ??= gl.getUniformLocation(program, key) });
      const fill = (target, array) => { gl.bindBuffer(target, gl.createBuffer()); gl.bufferData(target, array, gl.STATIC_DRAW); };
      const bind = (elements) => {
        const vao = gl.createVertexArray(); gl.bindVertexArray(vao);
        fill(gl.ELEMENT_ARRAY_BUFFER, elements);
        gl.bindBuffer(gl.ARRAY_BUFFER, this.placeBuffer);
        gl.enableVertexAttribArray(0); gl.vertexAttribPointer(0, 3, gl.UNSIGNED_SHORT, true, 0, 0);
        gl.bindBuffer(gl.ARRAY_BUFFER, this.ownerBuffer);
        gl.enableVertexAttribArray(1); gl.vertexAttribIPointer(1, 1, gl.UNSIGNED_INT, 0, 0);
        return vao;
      };
      fill(gl.ARRAY_BUFFER, places); this.placeBuffer = gl.getParameter(gl.ARRAY_BUFFER_BINDING);
      fill(gl.ARRAY_BUFFER, owner); this.ownerBuffer = gl.getParameter(gl.ARRAY_BUFFER_BINDING);
      this.faces = bind(triangles); this.edges = bind(lines);
      gl.bindTexture(gl.TEXTURE_2D, gl.createTexture());
      gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MIN_FILTER, gl.NEAREST);
      gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MAG_FILTER, gl.NEAREST);
      this.upload();
      for (const key of ["low", "span", "middle"]) gl.uniform3fv(this.at[key], scene[key]);
      gl.uniform1f(this.at.radius, scene.radius);
      gl.enable(gl.DEPTH_TEST); gl.depthFunc(gl.LEQUAL);
      gl.blendFuncSeparate(gl.SRC_ALPHA, gl.ONE_MINUS_SRC_ALPHA, gl.ONE, gl.ONE_MINUS_SRC_ALPHA);
      this.pick = gl.createFramebuffer(); this.pickColour = gl.createRenderbuffer(); this.pickDepth = gl.createRenderbuffer();
    }

    upload() {  // what each part looks like: colour, and whether it is hidden (0), chosen (153) or plain
      const { gl } = this, tall = this.states.length / 4096;
      gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA8, 1024, tall, 0, gl.RGBA, gl.UNSIGNED_BYTE, this.states);
      this.refresh();
    }

    mark(marks) {
      this.chosen = new Set(marks.map((mark) => this.index.get(mark)).filter((k) => k !== undefined));
      for (const { first, last, on } of this.families)
        for (let k = first; k < last; k++) this.states[4 * k + 3] = this.chosen.has(k) ? 153 : on ? 255 : 0;
      this.upload();
    }

    fit() {  // close enough that the scene fills the frame, as seen from home
      const { scene, places } = this, { axes, distance, slope } = this.camera();
      const step = axes.map((axis) => axis.map((c, k) => c * scene.span[k] / 65535 / scene.radius));
      const start = axes.map((axis) => axis.reduce((n, c, k) => n + c * (scene.low[k] - scene.middle[k]), 0) / scene.radius);
      let [left, right, low, high] = [9, -9, 9, -9];
      for (let i = 0; i < places.length; i += 3) {
        const [x, y, z] = step.map((s, k) => start[k] + s[0] * places[i] + s[1] * places[i + 1] + s[2] * places[i + 2]);
        const h = x / (distance - z), v = y / (distance - z);
        if (h < left) left = h; if (h > right) right = h;
        if (v < low) low = v; if (v > high) high = v;
      }
      const aspect = this.canvas.clientWidth / Math.max(this.canvas.clientHeight, 1) || 1;
      const half = Math.max((right - left) / 2 / aspect, (high - low) / 2, 1e-6);
      this.home = { zoom: 0.94 * slope / half, x: (left + right) / 2, y: (low + high) / 2 };
      Object.assign(this, this.home);
    }

    camera() {
      const [azimuth, elevation, opening] = this.pose.view, rad = Math.PI / 180;
      const [ca, sa, ce, se] = [Math.cos(azimuth * rad), Math.sin(azimuth * rad), Math.cos(elevation * rad), Math.sin(elevation * rad)];
      const right = [-sa, ca, 0], up = [-se * ca, -se * sa, ce], back = [ce * ca, ce * sa, se];
      const { width, height } = this.canvas, slope = Math.tan(opening * rad / 2), distance = 1 / Math.sin(opening * rad / 2);
      const near = distance - 1.1, far = distance + 1.1, fy = this.zoom / slope, fx = fy * height / width;
      // Clip space: x, y by the lens, shifted by the pan; z between near and far; w the distance.
      const a = (far + near) / (far - near), b = 2 * far * near / (far - near);
      const columns = [0, 1, 2].flatMap((k) => [fx * (right[k] + this.x * back[k]), fy * (up[k] + this.y * back[k]), -a * back[k], -back[k]]);
      columns.push(-fx * this.x * distance, -fy * this.y * distance, a * distance - b, distance);
      const eye = back.map((c) => c * distance);
      const sun = [0, 1, 2].map((k) => -0.55 * right[k] + 0.25 * up[k] + 0.45 * back[k] + (k === 2 ? 0.62 : 0));
      const size = Math.hypot(...sun);
      return { axes: [right, up, back], columns, eye, sun: sun.map((c) => c / size), distance, slope };
    }

    refresh() { this.waiting ??= requestAnimationFrame(() => { this.waiting = null; this.draw(); }); }

    prepare() {
      const { gl, canvas } = this, ratio = 2;  // twice as fine as the page: thin joints stay lines
      const width = Math.max(1, Math.round(canvas.clientWidth * ratio)), height = Math.max(1, Math.round(canvas.clientHeight * ratio));
      if (canvas.width !== width || canvas.height !== height) { canvas.width = width; canvas.height = height; }
      const { columns, eye, sun } = this.camera();
      gl.viewport(0, 0, width, height);
      gl.uniformMatrix4fv(this.at.camera, false, columns);
      gl.uniform3fv(this.at.eye, eye); gl.uniform3fv(this.at.sun, sun);
      gl.uniform1i(this.at.marked, this.chosen?.size ? 1 : 0);
      gl.uniform1ui(this.at.hot, this.hot ?? 0xffffffff);
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
      this.prepare();
      gl.clearColor(0, 0, 0, 0); gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
      if (this.hazeAt !== undefined) {  // from far to near: S behind, the sphere as a haze, S in front
        gl.enable(gl.CULL_FACE); gl.cullFace(gl.FRONT); this.solid(0); gl.cullFace(gl.BACK);
        gl.enable(gl.BLEND); gl.disable(gl.DEPTH_TEST);
        this.solid(3, this.hazeAt, this.total);
        gl.disable(gl.BLEND); gl.enable(gl.DEPTH_TEST); gl.clear(gl.DEPTH_BUFFER_BIT);
        this.solid(0); gl.disable(gl.CULL_FACE);
        // The sphere's far side must not show the edges behind it.
        gl.colorMask(false, false, false, false); gl.depthMask(true);
        gl.enable(gl.CULL_FACE); gl.cullFace(gl.FRONT); this.solid(3, this.hazeAt, this.total);
        gl.disable(gl.CULL_FACE); gl.colorMask(true, true, true, true);
      } else this.solid(0);
      this.wire();
      if (this.chosen?.size) {  // what is chosen shines through what stands before it
        gl.disable(gl.DEPTH_TEST); gl.enable(gl.BLEND); this.solid(4); gl.disable(gl.BLEND); gl.enable(gl.DEPTH_TEST);
      }
    }

    find(event) {  // which part is under the pointer: one pixel of a picture of part numbers
      const { gl, canvas } = this;
      this.prepare();
      gl.bindFramebuffer(gl.FRAMEBUFFER, this.pick);
      if (this.pickSize !== `${canvas.width} ${canvas.height}`) {
        for (const [buffer, kind, place] of [[this.pickColour, gl.RGBA8, gl.COLOR_ATTACHMENT0],
          [this.pickDepth, gl.DEPTH_COMPONENT16, gl.DEPTH_ATTACHMENT]]) {
          gl.bindRenderbuffer(gl.RENDERBUFFER, buffer);
          gl.renderbufferStorage(gl.RENDERBUFFER, kind, canvas.width, canvas.height);
          gl.framebufferRenderbuffer(gl.FRAMEBUFFER, place, gl.RENDERBUFFER, buffer);
        }
        this.pickSize = `${canvas.width} ${canvas.height}`;
      }
      const box = canvas.getBoundingClientRect(), ratio = canvas.width / box.width;
      const x = Math.floor((event.clientX - box.left) * ratio), y = canvas.height - 1 - Math.floor((event.clientY - box.top) * ratio);
      gl.enable(gl.SCISSOR_TEST); gl.scissor(x, y, 1, 1);
      gl.clearColor(0, 0, 0, 0); gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
      this.solid(2);
      const pixel = new Uint8Array(4);
      gl.readPixels(x, y, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, pixel);
      gl.disable(gl.SCISSOR_TEST); gl.bindFramebuffer(gl.FRAMEBUFFER, null);
      const found = pixel[0] + (pixel[1] << 8) + (pixel[2] << 16) - 1;
      return found < 0 ? undefined : found;
    }

    hover(event) {
      const found = this.find(event), mark = this.marks[found], { tip } = this;
      if (found !== this.hot) { this.hot = found; if (!pinned) show(mark); this.refresh(); }
      tip.hidden = mark === undefined;
      if (mark === undefined) return;
      const note = [data.parts[mark], this.field && `${this.field.name.toLowerCase()} ${this.field.values[found]}`].filter(Boolean);
      tip.replaceChildren(Object.assign(document.createElement("b"), { textContent: mark }), " " + note.join(", "));
      const box = this.canvas.getBoundingClientRect(), x = event.clientX - box.left;
      tip.style.left = `${Math.max(0, Math.min(x + 14, box.width - tip.offsetWidth - 4))}px`;
      tip.style.top = `${Math.max(0, event.clientY - box.top - tip.offsetHeight - 10)}px`;
    }

    turn(dx, dy) {
      this.pose.view[0] -= dx; this.pose.view[1] = Math.max(-89, Math.min(89, this.pose.view[1] + dy));
      for (const view of views) if (view.pose === this.pose) view.refresh();
    }
    scale(factor) { this.zoom = Math.max(0.4, Math.min(60, this.zoom * factor)); this.refresh(); }
    move(dx, dy) {
      const per = 2 * this.camera().slope / this.zoom / this.canvas.clientHeight;
      this.x -= dx * per; this.y += dy * per; this.refresh();
    }

    listen() {
      const { canvas } = this, held = new Map();
      let moved = 0, active = false;
      const spread = () => { const [a, b] = [...held.values()]; return Math.hypot(a.x - b.x, a.y - b.y); };
      canvas.addEventListener("pointerdown", (e) => {
        canvas.setPointerCapture(e.pointerId); held.set(e.pointerId, { x: e.clientX, y: e.clientY }); moved = 0; active = true;
      });
      canvas.addEventListener("pointermove", (e) => {
        const was = held.get(e.pointerId);
        if (!was) { if (e.pointerType === "mouse") this.hover(e); return; }
        const dx = e.clientX - was.x, dy = e.clientY - was.y, before = held.size === 2 ? spread() : 0;
        held.set(e.pointerId, { x: e.clientX, y: e.clientY });
        moved += Math.abs(dx) + Math.abs(dy); this.tip.hidden = true;
        if (before) { this.scale(spread() / Math.max(before, 1)); this.move(dx / 2, dy / 2); }
        else if (e.shiftKey || e.buttons & 6) this.move(dx, dy);
        else this.turn(0.35 * dx, 0.35 * dy);
      });
      const end = (e) => {
        if (held.delete(e.pointerId) && moved < 4 && e.type === "pointerup") { this.hover(e); pin(this.marks[this.hot] ?? ""); }
      };
      canvas.addEventListener("pointerup", end); canvas.addEventListener("pointercancel", end);
      canvas.addEventListener("pointerleave", () => {
        this.hot = undefined; this.tip.hidden = true; active = false; if (!pinned) show(""); this.refresh();
      });
      // The wheel scrolls the page until the view has been clicked; then it zooms.
      canvas.addEventListener("wheel", (e) => {
        if (!active && !e.ctrlKey) return;
        e.preventDefault(); this.scale(Math.exp(-0.0015 * e.deltaY));
      }, { passive: false });
      canvas.addEventListener("contextmenu", (e) => e.preventDefault());
      canvas.addEventListener("dblclick", () => { Object.assign(this, this.home); this.pose.view = [...this.pose.home]; this.turn(0, 0); });
      canvas.addEventListener("keydown", (e) => {
        const steps = { ArrowLeft: [-6, 0], ArrowRight: [6, 0], ArrowUp: [0, -6], ArrowDown: [0, 6] }[e.key];
        if (steps) this.turn(...steps);
        else if (e.key === "+" || e.key === "=") this.scale(1.2);
        else if (e.key === "-") this.scale(1 / 1.2);
        else return;
        e.preventDefault();
      });
    }

    toggles() {
      const bar = this.figure.querySelector(".tools"), solids = this.families.filter((f) => f.name !== "sphere");
      if (solids.length > 1) for (const family of solids) {
        const label = document.createElement("label"), box = Object.assign(document.createElement("input"), { type: "checkbox", checked: true });
        box.addEventListener("change", () => { family.on = box.checked; this.mark(shown); });
        label.append(box, " ", family.name); bar.append(label);
      }
      const fields = this.scene.fields ?? [];
      if (fields.length) {
        const select = document.createElement("select");
        select.setAttribute("aria-label", "Colour by");
        for (const { name } of fields) select.append(new Option(name));
        select.addEventListener("change", () => { for (const view of views) view.paint?.(fields[select.selectedIndex]); });
        const label = document.createElement("label");
        label.append("Colour by ", select); bar.append(label);
      }
    }

    paint(field) {
      if (!this.pose.linked) return;
      const stops = [...data.ramp, data.neutral].map((c) => [1, 3, 5].map((k) => parseInt(c.slice(k, k + 2), 16)));
      const last = data.ramp.length - 1;
      decode(field.places).forEach((place, k) => {
        const x = place / 254 * last, i = Math.min(Math.floor(x), last - 1);
        const mixed = place === 255 ? stops[last + 1] : stops[i].map((c, j) => c + (x - i) * (stops[i + 1][j] - c));
        this.states.set(mixed.map(Math.round), 4 * k);
      });
      this.field = field;
      const scale = this.figure.querySelector(".scale");
      if (scale) { scale.firstElementChild.textContent = field.low; scale.lastElementChild.textContent = field.high; }
      this.upload();
    }
  }

  const poses = new Map();
  for (const figure of document.querySelectorAll("figure[data-scene]")) {
    const scene = data.scenes[figure.dataset.scene];
    if (!scene) continue;
    const key = scene.turns ?? figure.dataset.scene;  // M and S turn together
    if (!poses.has(key)) poses.set(key, { view: [...scene.view], home: scene.view, linked: Boolean(scene.turns) });
    try { views.push(new View(figure, scene, poses.get(key))); } catch (error) { console.info(`${error.message}: the picture stays`); }
  }
  const fields = data.scenes.shell?.fields;
  if (fields?.length) for (const view of views) view.paint(fields[0]);

  for (const button of document.querySelectorAll("button[data-mark]"))
    button.addEventListener("click", () => {
      pin(button.dataset.mark);
      if (pinned) document.querySelector("figure[data-scene]")?.scrollIntoView({ behavior: "smooth", block: "center" });
    });
  for (const nodes of drawn.values()) for (const node of nodes) {
    node.addEventListener("pointerenter", () => { if (!pinned) show(node.dataset.mark); });
    node.addEventListener("pointerleave", () => { if (!pinned) show(""); });
    node.addEventListener("click", (e) => { e.stopPropagation(); pin(node.dataset.mark); });
  }
  for (const sheet of document.querySelectorAll("figure.sheet"))
    sheet.addEventListener("click", () => sheet.classList.toggle("large"));
  const search = document.getElementById("find");
  search?.addEventListener("input", () => { pinned = ""; pin(search.value.trim().toUpperCase()); });
})();
