// One 3-D view of a scene: orbit, zoom, move, explode, fly, point at parts.
class View extends Drawing {
  // pose: azimuth and elevation, shared by views that turn together (pose.views).
  constructor(figure, scene, pose, heed) {
    super();
    Object.assign(this, { figure, scene, pose, heed, explode: 0, target: [0, 0, 0], distance: 5, atHome: true, ratio: FINE });
    this.home = { azimuth: pose.azimuth, elevation: pose.elevation };
    this.canvas = document.createElement("canvas");
    this.canvas.tabIndex = 0;
    this.canvas.setAttribute("role", "application");
    this.canvas.setAttribute("aria-roledescription", "3-D view");
    this.canvas.setAttribute("aria-label", `${figure.dataset.name}. Arrow keys turn, plus and minus zoom.`);
    this.gl = this.canvas.getContext("webgl2", { antialias: devicePixelRatio > 1, alpha: true });
    if (!this.gl) throw new Error("This browser has no WebGL 2");
    this.build();
    this.tip = document.createElement("output");
    figure.querySelector(".frame").append(this.canvas, this.tip);
    figure.classList.add("live");
    this.canvas.addEventListener("webglcontextlost", () => figure.classList.remove("live"));
    pose.views.push(this);
    this.listen();
    new ResizeObserver(() => { if (this.atHome) this.fit(); this.refresh(); }).observe(this.canvas);
    new IntersectionObserver(([entry]) => { this.inSight = entry.isIntersecting; this.refresh(); }).observe(this.canvas);
  }

  // --- where it is seen from ---

  get reach() { return 1 + 0.8 * this.explode; }  // radius of all that is shown
  get aspect() { return this.canvas.clientWidth / Math.max(this.canvas.clientHeight, 1) || 1; }

  // The camera that just shows all visible parts, or those in `only`.
  framing(look, only) {
    const { right, up, back } = axesOf(look), sy = 0.92 * SLOPE, sx = sy * this.aspect, { points, shift, explode, owner } = this;
    const p = [0, 0, 0];
    let [a, b, c, d, near, far] = Array(6).fill(-Infinity);
    for (let v = 0; v < owner.length; v++) {
      if (only ? !only.has(owner[v]) : !this.states[4 * owner[v] + 3]) continue;
      for (let k = 0; k < 3; k++) p[k] = points[3 * v + k] + explode * shift[3 * v + k];
      const x = dot(right, p), y = dot(up, p), z = dot(back, p);
      a = Math.max(a, x + sx * z); b = Math.max(b, sx * z - x);
      c = Math.max(c, y + sy * z); d = Math.max(d, sy * z - y);
      near = Math.max(near, z); far = Math.max(far, -z);
    }
    if (a === -Infinity) return { target: [0, 0, 0], distance: 5 };
    const x = (a - b) / 2, y = (c - d) / 2, z = (near - far) / 2;
    return {
      target: [0, 1, 2].map((k) => x * right[k] + y * up[k] + z * back[k]),
      distance: Math.max((a + b) / (2 * sx), (c + d) / (2 * sy)) - z,
    };
  }

  fit(time = 0) { this.go({ ...this.framing(this.pose) }, time); this.atHome = true; }
  reset(time = 0) { this.go({ ...this.home, ...this.framing(this.home) }, time); this.atHome = true; }

  flyTo(marks, time = 700) {
    const parts = new Set(marks.map((mark) => this.index.get(mark)).filter((k) => k !== undefined));
    if (!parts.size) return;
    const axis = [0, 1, 2].map((c) => [...parts].reduce((n, k) => n + this.axis[3 * k + c], 0)), size = Math.hypot(...axis);
    const look = { azimuth: this.pose.azimuth, elevation: this.pose.elevation };
    if (size > 0.1) {  // from where the part's outside is seen, a little askew
      look.elevation = clamp(Math.asin(axis[2] / size) / RAD, -70, 70);
      if (Math.hypot(axis[0], axis[1]) > 0.2 * size) look.azimuth = Math.atan2(axis[1], axis[0]) / RAD - 16;
      look.elevation += look.elevation > 50 ? -14 : 8;
    }
    const { target, distance } = this.framing(look, parts), all = this.framing(look).distance;
    this.go({ ...look, target, distance: clamp(3.4 * distance, 0.3 * all, 0.8 * all) }, time);
    this.atHome = false;
  }

  go(to, time) {
    const from = { azimuth: this.pose.azimuth, elevation: this.pose.elevation, target: this.target, distance: this.distance, explode: this.explode };
    const goal = { ...from, ...to }, turn = ((goal.azimuth - from.azimuth) % 360 + 540) % 360 - 180;
    const set = (s) => {
      const mix = (a, b) => a + s * (b - a);
      this.pose.azimuth = from.azimuth + s * turn; this.pose.elevation = mix(from.elevation, goal.elevation);
      this.target = from.target.map((c, k) => mix(c, goal.target[k]));
      this.distance = from.distance * (goal.distance / from.distance) ** s;
      if (goal.explode !== from.explode) { this.explode = mix(from.explode, goal.explode); this.stale = true; }
      for (const view of this.pose.views) view.refresh();
    };
    cancelAnimationFrame(this.flight); this.flight = undefined;
    if (!time || calm.matches) { set(1); return; }
    const begin = performance.now();
    const step = (now) => {
      const s = clamp((now - begin) / time, 0, 1);
      set(s * s * (3 - 2 * s));
      this.flight = s < 1 ? requestAnimationFrame(step) : undefined;
    };
    this.flight = requestAnimationFrame(step);
  }

  halt() { cancelAnimationFrame(this.flight); this.flight = undefined; }
  turn(dx, dy) {
    this.halt();
    this.pose.azimuth -= dx; this.pose.elevation = clamp(this.pose.elevation + dy, -89, 89);
    for (const view of this.pose.views) { view.atHome = false; view.refresh(); }
  }
  get perPixel() { return 2 * SLOPE * this.distance / Math.max(this.canvas.clientHeight, 1); }
  shiftBy(x, y) { const { right, up } = axesOf(this.pose); this.target = this.target.map((c, k) => c + x * right[k] + y * up[k]); }
  move(dx, dy) { this.halt(); this.shiftBy(-dx * this.perPixel, dy * this.perPixel); this.atHome = false; this.refresh(); }
  zoom(factor, event) {  // towards the pointer, where there is one
    this.halt();
    const distance = clamp(this.distance / factor, 0.08, 30), share = 1 - distance / this.distance;
    if (event) {
      const box = this.canvas.getBoundingClientRect(), per = this.perPixel;
      this.shiftBy((event.clientX - box.left - box.width / 2) * per * share, -(event.clientY - box.top - box.height / 2) * per * share);
    }
    this.distance = distance; this.atHome = false; this.refresh();
  }

  camera() {
    const { right, up, back } = axesOf(this.pose), { distance, target } = this;
    const eye = target.map((c, k) => c + distance * back[k]), off = Math.hypot(...eye);
    const near = Math.max(0.02 * distance, off - 1.05 * this.reach), far = off + Math.max(this.reach, 2.8);  // the ground reaches far
    const fy = 1 / SLOPE, fx = fy / this.aspect, a = (far + near) / (far - near), b = 2 * far * near / (far - near);
    const columns = [0, 1, 2].flatMap((k) => [fx * right[k], fy * up[k], -a * back[k], -back[k]]);
    const [x, y, z] = [right, up, back].map((axis) => dot(axis, eye));
    columns.push(-fx * x, -fy * y, a * z - b, z);
    return { columns, eye };
  }

  project(k) {  // where part k is on the page, in CSS pixels
    const { right, up, back } = axesOf(this.pose), { eye } = this.camera(), p = this.middle(k).map((c, i) => c - eye[i]);
    const away = -dot(back, p), box = this.canvas.getBoundingClientRect(), per = box.height / (2 * SLOPE);
    return { x: box.left + box.width / 2 + dot(right, p) / away * per, y: box.top + box.height / 2 - dot(up, p) / away * per };
  }

  // --- showing ---

  refresh() { if (this.inSight) this.waiting ??= requestAnimationFrame((now) => { this.waiting = null; this.pace(now); this.draw(); }); }

  pace(now) {  // where frames take long, coarser ones do until the view is still
    const since = now - (this.last ?? 0);
    this.last = now;
    if (since < 1000) this.ratio = since > 90 ? Math.max(this.ratio - 0.5, 0.75) : this.ratio;
    clearTimeout(this.still);
    if (this.ratio < FINE) this.still = setTimeout(() => { this.ratio = FINE; this.last = undefined; this.refresh(); }, 400);
  }

  // --- pointing ---

  hover(event) {
    const found = event && this.find(event), mark = this.marks[found], { tip } = this;
    if (found !== this.hot) { this.hot = found; this.refresh(); this.heed.hover(mark); }
    tip.hidden = mark === undefined;
    if (mark === undefined) return;
    const name = document.createElement("b");
    name.textContent = mark; tip.replaceChildren(name, ` ${this.heed.note(mark)}`);
    const box = this.canvas.getBoundingClientRect(), x = event.clientX - box.left;
    tip.style.left = `${clamp(x + 14, 0, Math.max(box.width - tip.offsetWidth - 4, 0))}px`;
    tip.style.top = `${Math.max(0, event.clientY - box.top - tip.offsetHeight - 10)}px`;
  }

  listen() {
    const { canvas } = this, held = new Map();
    let moved = 0, most = 0;
    const spread = () => { const [a, b] = [...held.values()]; return Math.hypot(a.clientX - b.clientX, a.clientY - b.clientY); };
    const middle = () => { const [a, b] = [...held.values()]; return { clientX: (a.clientX + b.clientX) / 2, clientY: (a.clientY + b.clientY) / 2 }; };
    canvas.addEventListener("pointerdown", (e) => {
      canvas.setPointerCapture(e.pointerId); held.set(e.pointerId, { clientX: e.clientX, clientY: e.clientY });
      most = held.size === 1 ? 1 : Math.max(most, held.size); if (most === 1) moved = 0;
      this.halt(); canvas.focus({ preventScroll: true });
    });
    canvas.addEventListener("pointermove", (e) => {
      const was = held.get(e.pointerId);
      if (!was) { if (e.pointerType === "mouse") this.hover(e); return; }
      const dx = e.clientX - was.clientX, dy = e.clientY - was.clientY, before = held.size === 2 ? spread() : 0;
      held.set(e.pointerId, { clientX: e.clientX, clientY: e.clientY });
      moved += Math.abs(dx) + Math.abs(dy);
      if (moved < 4) return;
      this.tip.hidden = true;
      if (before) { this.zoom(spread() / Math.max(before, 1), middle()); this.move(dx / 2, dy / 2); }
      else if (e.shiftKey || e.buttons & 6) this.move(dx, dy);
      else this.turn(0.35 * dx, 0.35 * dy);
    });
    const end = (e) => {
      if (held.delete(e.pointerId) && moved < 4 && most === 1 && e.type === "pointerup" && e.button === 0)
        this.heed.click(this.marks[this.find(e, e.pointerType === "mouse" ? 2 : 9)]);
    };
    canvas.addEventListener("pointerup", end); canvas.addEventListener("pointercancel", end);
    canvas.addEventListener("pointerleave", () => this.hover(null));
    // The wheel scrolls the page until the view has been clicked; then it zooms.
    canvas.addEventListener("wheel", (e) => {
      if (document.activeElement !== canvas && !e.ctrlKey && !document.fullscreenElement) return;
      e.preventDefault(); this.zoom(Math.exp(-(e.ctrlKey ? 0.01 : 0.0015) * clamp(e.deltaY, -300, 300)), e);
    }, { passive: false });
    canvas.addEventListener("contextmenu", (e) => e.preventDefault());
    canvas.addEventListener("dblclick", () => this.reset(500));
    canvas.addEventListener("keydown", (e) => {
      if (e.ctrlKey || e.metaKey || e.altKey) return;
      const steps = { ArrowLeft: [-8, 0], ArrowRight: [8, 0], ArrowUp: [0, -8], ArrowDown: [0, 8] }[e.key];
      if (steps && e.shiftKey) this.move(-5 * steps[0], -5 * steps[1]);
      else if (steps) this.turn(...steps);
      else if (e.key === "+" || e.key === "=") this.zoom(1.25);
      else if (e.key === "-") this.zoom(1 / 1.25);
      else return;
      e.preventDefault();
    });
  }
}
