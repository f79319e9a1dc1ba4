// The stage and the page around it: what is chosen is shown in every view, on its sheet, on the card.
const byId = (id) => document.getElementById(id);
const make = (tag, props = {}, ...inside) => {
  const node = Object.assign(document.createElement(tag), props);
  node.append(...inside.filter((one) => one !== null && one !== ""));
  return node;
};
const SVG = document.createRange().createContextualFragment("<svg></svg>").firstChild.namespaceURI;
const views = {}, stage = byId("stage"), card = byId("card");
const drawn = new Map();  // mark -> its elements in the sheets
for (const node of document.querySelectorAll(".sheet [data-mark]")) {
  if (!drawn.has(node.dataset.mark)) drawn.set(node.dataset.mark, []);
  drawn.get(node.dataset.mark).push(node);
}
let chosen = [], hot = "", why = null;
const solids = (mark) => model.also[mark] ?? (mark in model.parts || model.faces.includes(mark) ? [mark] : []);

// --- choosing parts ---

function show() {
  const marks = chosen.length ? chosen : hot ? [hot] : [], found = marks.flatMap(solids);
  const beside = chosen.length ? chosen.flatMap((mark) => model.parts[mark]?.near ?? []) : [];
  for (const node of document.querySelectorAll(".sheet .hot")) node.classList.remove("hot");
  for (const mark of found) for (const node of drawn.get(mark) ?? []) node.classList.add("hot");
  for (const view of Object.values(views)) view.mark(found, beside.filter((mark) => !found.includes(mark)));
}

// marks: what to choose, none to let go; fly: go and look at it; check: the table row it comes from.
function choose(marks, { fly = false, check = null } = {}) {
  chosen = marks.filter((mark) => solids(mark).length); why = check;
  show();
  if (!stage) return;
  fill();
  if (fly) views.assembly?.flyTo(chosen.flatMap(solids));
  byId("said").textContent = chosen.length ? `${chosen.join(", ")}: ${chosen.map(note).join("; ")}` : "";
  const place = chosen.length ? `#${chosen.join(",")}` : location.href.split("#")[0];
  try { history.replaceState(null, "", place); } catch { /* some browsers refuse it for a file */ }
}
const toggle = (mark) => choose(!mark || (chosen.length === 1 && chosen[0] === mark) ? [] : [mark]);
const note = (mark) => model.notes[mark] ?? (model.also[mark] ? `node without a hub, ${model.also[mark].length} beams` : "");

// --- the card ---

const link = (mark) => {
  const button = make("button", { type: "button", className: "mark", textContent: mark, title: note(mark) });
  button.addEventListener("click", () => choose([mark], { fly: true }));
  button.addEventListener("pointerenter", () => views.assembly && light(mark));
  button.addEventListener("pointerleave", () => views.assembly && light(undefined));
  return button;
};
function light(mark) { views.assembly.hot = views.assembly.index.get(mark); views.assembly.refresh(); }
const marked = (text) => (text && (text in model.parts || text in model.also) ? link(text) : text);

function table(caption, heads, rows) {
  const used = heads.map((_, k) => rows.some((row) => row[k] && row[k] !== "0°"));
  const cells = (tag, row) => row.filter((_, k) => used[k]).map((text) => make(tag, {}, tag === "th" ? text : marked(text)));
  return make("table", {}, make("caption", { textContent: caption }),
    make("thead", {}, make("tr", {}, make("th", { textContent: "" }), ...cells("th", heads))),
    make("tbody", {}, ...rows.map((row, k) => make("tr", {}, make("th", { scope: "row", textContent: k + 1 }), ...cells("td", row)))));
}

function place(mark, name) {  // the sheet with the part on it
  const sheet = [...document.querySelectorAll(".sheet svg")].find((svg) => svg.getAttribute("aria-label") === name);
  if (!sheet) return null;
  const copy = sheet.cloneNode(true);
  for (const node of copy.querySelectorAll(".engrave, text, title")) node.remove();
  for (const node of copy.querySelectorAll("[data-mark]")) node.classList.toggle("hot", node.dataset.mark === mark);
  const button = make("button", { type: "button", className: "place", title: "Show the sheet" }, copy, make("span", { textContent: name }));
  button.setAttribute("aria-label", `${mark} on sheet ${name}: show the sheet`);
  button.addEventListener("click", () => {
    const figure = sheet.closest("figure");
    figure.classList.add("large"); figure.scrollIntoView({ behavior: calm.matches ? "auto" : "smooth", block: "center" });
  });
  return button;
}

function shape(mark) {  // the cut contour with its edges numbered as in the table
  const d = drawn.get(mark)?.[0].querySelector(".cut").getAttribute("d");
  if (!d) return null;
  const points = d.slice(1, -1).split("L").map((pair) => pair.split(" ").map(Number)), n = points.length;
  const low = [0, 1].map((c) => Math.min(...points.map((p) => p[c]))), high = [0, 1].map((c) => Math.max(...points.map((p) => p[c])));
  const size = Math.hypot(high[0] - low[0], high[1] - low[1]), rim = 0.01 * size, inwards = 0.055 * size;
  const draw = (tag, attributes, text = "") => {
    const node = document.createElementNS(SVG, tag);
    for (const [name, value] of Object.entries(attributes)) node.setAttribute(name, value);
    node.textContent = text;
    return node;
  };
  const svg = draw("svg", { viewBox: [low[0] - rim, low[1] - rim, high[0] - low[0] + 2 * rim, high[1] - low[1] + 2 * rim].join(" "), role: "img", "aria-label": `${mark}, its edges numbered` });
  svg.append(draw("path", { d }), ...points.map((a, k) => {
    const b = points[(k + 1) % n], along = Math.hypot(b[0] - a[0], b[1] - a[1]), x = (a[0] + b[0]) / 2 + inwards * (b[1] - a[1]) / along, y = (a[1] + b[1]) / 2 - inwards * (b[0] - a[0]) / along;
    return draw("text", { x, y, "font-size": 0.055 * size }, k + 1);
  }));
  return make("div", { className: "shape" }, svg);
}

function part(mark) {
  const own = model.parts[mark], kind = own?.kind ?? "node";
  if (!own) return [make("p", { className: "soft", textContent: `A node without a hub: ${solids(mark).length} beams meet here.` }),
    make("p", { className: "near" }, ...solids(mark).map(link))];
  const facts = make("dl"), add = (name, text) => text && facts.append(make("dt", { textContent: name }), make("dd", { textContent: text }));
  model.labels[kind].forEach((name, k) => add(name, own.values[k]));
  const face = kind === "panel" ? model.faces.indexOf(mark) : -1;
  if (face >= 0) for (const field of model.fields.slice(0, 2)) add(field.name, field.values[face]);
  const loose = own.near.filter((near) => !own.rows.some((row) => row.includes(near)));
  return [facts, own.sheet ? place(mark, own.sheet) : null, kind === "panel" ? shape(mark) : null,
    own.rows.length ? table(kind === "panel" ? "Edges, mm" : "Ends", kind === "panel" ? model.edges : model.ends, own.rows) : null,
    loose.length ? make("h4", { textContent: "Next to" }) : null, loose.length ? make("p", { className: "near" }, ...loose.map(link)) : null];
}

const rows = [...document.querySelectorAll("tr[data-worst]")];
const said = (row) => ({ name: row.dataset.name, worst: row.dataset.worst.split(", ").filter(Boolean), bad: row.classList.contains("bad"),
  value: row.cells[1].textContent, limit: row.cells[2].textContent, note: row.cells[5].textContent });

function fill() {
  const close = make("button", { type: "button", className: "close", textContent: "×" });
  close.setAttribute("aria-label", "Let go");
  close.addEventListener("click", () => { choose([]); views.assembly?.canvas.focus({ preventScroll: true }); });
  if (!chosen.length) {
    const items = rows.map((row) => {
      const { name, worst, bad, value } = said(row);
      const button = make("button", { type: "button", className: bad ? "bad" : "good", disabled: !worst.length }, make("i", {}, bad ? "✕" : "✓"),
        make("span", { textContent: name }), make("b", { textContent: value }));
      button.setAttribute("aria-label", `${name}: ${value}, ${bad ? "fails" : "passes"}${worst.length ? `; fly to ${worst.join(" and ")}` : ""}`);
      button.addEventListener("click", () => visit(row));
      return make("li", {}, button);
    });
    card.replaceChildren(make("h3", { textContent: rows.length ? "Checks" : "Parts" }),
      make("p", { className: "soft", textContent: `${rows.length ? "Click one to fly to its worst part, or c" : "C"}lick a part in the view.` }),
      make("ul", { className: "checks" }, ...items));
    return;
  }
  const first = chosen[0], kind = model.parts[first]?.kind ?? "node", pieces = [make("h3", {}, first, make("small", { textContent: kind === "node" && model.parts[first] ? "hub" : kind })), close];
  if (why) {
    const { name, bad, value, limit, note } = said(why);
    pieces.push(make("p", { className: bad ? "why bad" : "why" }, make("b", { textContent: `${bad ? "✕" : "✓"} ${name}` }), ` ${value} (${limit}): ${note}`));
  }
  if (chosen.length > 1) pieces.push(make("p", { className: "near" }, "with ", ...chosen.slice(1).map(link)));
  const top = make("div", { className: "top" }, ...pieces);
  card.replaceChildren(top, ...part(first).filter(Boolean)); card.scrollTop = 0;
}

function visit(row) {
  const { worst } = said(row);
  if (!worst.length) return;
  stage.scrollIntoView({ behavior: calm.matches ? "auto" : "smooth", block: "nearest" });
  choose(worst, { fly: true, check: row });
}
if (stage) for (const row of rows) row.addEventListener("click", () => visit(row));

// --- the views ---

const heed = { note, click: toggle, hover: (mark) => { hot = mark ?? ""; if (!chosen.length) show(); } };
const poses = new Map();
function open(figure) {
  const { scene: name, pose: key } = figure.dataset, scene = model.scenes[name];
  if (!scene) return;
  if (!poses.has(key)) poses.set(key, { azimuth: scene.view[0], elevation: scene.view[1], views: [] });
  try {
    const view = new View(figure, scene, poses.get(key), heed);
    views[figure.dataset.view] = view;
    view.fit();
  } catch (error) { console.info(`${error.message}: the picture stays`); }
}
const places = (field) => field && new Map(model.faces.map((mark, k) => [mark, field.places[k]]));
function paint(names, field, scale) {
  for (const name of names) views[name]?.paint(places(field), model.ramp, model.neutral);
  if (!scale) return;
  scale.hidden = !field;
  if (field) { scale.firstElementChild.textContent = field.low; scale.lastElementChild.textContent = field.high; }
  show();
}

function controls() {
  const view = views.assembly, layers = byId("layers"), inset = document.querySelector(".inset");
  const box = (name, on, change) => {
    const input = make("input", { type: "checkbox", checked: on }), key = layers.querySelectorAll("input").length + 1;
    input.addEventListener("change", () => change(input.checked));
    layers.append(make("label", { title: `Key ${key}` }, input, ` ${name}`));
  };
  view.scene.groups.forEach((name, k) => box(name, true, (on) => { view.shown[k] = on; show(); }));
  if (views.gaussInset) {
    inset.hidden = innerWidth < 900;
    box("Gauss image", !inset.hidden, (on) => { inset.hidden = !on; views.gaussInset.fit(); });
  }
  const explode = byId("explode");
  explode.addEventListener("input", () => { view.halt(); view.explode = explode.value / 100; view.stale = true; if (view.atHome) view.fit(); view.refresh(); });
  for (const { name } of model.fields) byId("colour").append(new Option(name));
  byId("colour").addEventListener("change", (e) => paint(["assembly", "gaussInset"], model.fields[e.target.selectedIndex - 1], byId("scale")));
  byId("fit").addEventListener("click", () => view.reset(500));
  const full = byId("full");
  full.hidden = !document.fullscreenEnabled;
  full.addEventListener("click", () => (document.fullscreenElement ? document.exitFullscreen() : stage.requestFullscreen()));
  byId("keys").addEventListener("click", () => byId("help").showModal());
}
function explodeTo(share) {
  const view = views.assembly;
  byId("explode").value = 100 * share;
  const now = view.explode; view.explode = share;
  const frame = view.atHome ? view.framing(view.pose) : {}; view.explode = now;
  const home = view.atHome;
  view.go({ ...frame, explode: share }, 600); view.atHome = home;
}

function search() {
  const input = byId("find"), list = byId("found"), all = [...new Set([...Object.keys(model.parts), ...Object.keys(model.also)])];
  let at = -1;
  const close = () => { list.hidden = true; input.setAttribute("aria-expanded", "false"); input.removeAttribute("aria-activedescendant"); at = -1; };
  const take = (mark) => { input.value = mark; close(); choose([mark], { fly: true }); };
  const move = (k) => {
    at = (k + list.children.length) % list.children.length;
    [...list.children].forEach((node, i) => node.setAttribute("aria-selected", String(i === at)));
    input.setAttribute("aria-activedescendant", list.children[at].id);
  };
  input.addEventListener("input", () => {
    const text = input.value.trim().toUpperCase();
    const found = text ? [...all.filter((mark) => mark.startsWith(text)), ...all.filter((mark) => !mark.startsWith(text) && mark.includes(text))].slice(0, 8) : [];
    list.replaceChildren(...found.map((mark, k) => {
      const item = make("li", { id: `found-${k}` }, make("b", { textContent: mark }), ` ${note(mark)}`);
      item.setAttribute("role", "option"); item.setAttribute("aria-selected", "false");
      item.addEventListener("pointerdown", (e) => { e.preventDefault(); take(mark); });
      return item;
    }));
    close(); list.hidden = !found.length; input.setAttribute("aria-expanded", String(found.length > 0));
  });
  input.addEventListener("keydown", (e) => {
    const open = !list.hidden && list.children.length;
    if (e.key === "ArrowDown" && open) move(at + 1);
    else if (e.key === "ArrowUp" && open) move(at - 1);
    else if (e.key === "Enter" && open) take(list.children[Math.max(at, 0)].firstChild.textContent);
    else if (e.key === "Escape") { close(); input.value = ""; views.assembly.canvas.focus({ preventScroll: true }); e.stopPropagation(); }
    else return;
    e.preventDefault();
  });
  input.addEventListener("blur", close);
}

function keys() {
  document.addEventListener("keydown", (e) => {
    const inside = stage.contains(e.target), view = views.assembly, boxes = byId("layers").querySelectorAll("input");
    if (e.ctrlKey || e.metaKey || e.altKey || byId("help").open || e.target.matches?.("input[type=search], select, textarea")) return;
    if (e.key === "Escape") { if (chosen.length) choose([]); return; }
    if (!inside && e.target !== document.body) return;
    if (e.key === "/") byId("find").focus();
    else if (e.key === "?") byId("help").showModal();
    else if (e.key === "f") chosen.length ? view.flyTo(chosen.flatMap(solids)) : view.fit(400);
    else if (e.key === "0" || e.key === "Home") view.reset(500);
    else if (e.key === "e") explodeTo(byId("explode").value > 50 ? 0 : 1);
    else if (boxes[e.key - 1]) boxes[e.key - 1].click();
    else return;
    e.preventDefault();
  });
}

function sheets() {
  model.engraving.forEach((paths, s) => {
    const groups = document.querySelectorAll(".sheet svg")[s].querySelectorAll("g.part");
    paths.forEach((d, k) => {
      if (!d) return;
      const path = document.createElementNS(SVG, "path");
      path.setAttribute("class", "engrave"); path.setAttribute("transform", "scale(.1)"); path.setAttribute("d", d);
      groups[k].append(path);
    });
  });
  for (const [mark, nodes] of drawn) for (const node of nodes) {
    node.addEventListener("pointerenter", () => heed.hover(mark));
    node.addEventListener("pointerleave", () => heed.hover());
    node.addEventListener("click", (e) => { e.stopPropagation(); choose([mark]); });
  }
  for (const sheet of document.querySelectorAll("figure.sheet")) sheet.addEventListener("click", () => sheet.classList.toggle("large"));
}

// --- opening ---

let model;
try {
  model = await unpack();
} catch (error) {
  for (const note of document.querySelectorAll(".old")) { note.textContent = `${error.message}: a picture stands in its place.`; note.hidden = false; }
  return;
}
for (const figure of document.querySelectorAll("figure[data-scene]")) open(figure);
if (views.assembly) { stage.classList.add("live"); controls(); search(); keys(); fill(); }
const select = byId("field");
if (select && views.shell) {
  for (const { name } of model.fields) select.append(new Option(name));
  const change = () => paint(["shell", "gauss"], model.fields[select.selectedIndex], byId("ramp"));
  select.addEventListener("change", change); select.parentElement.hidden = false; change();
}
sheets();
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => { for (const view of Object.values(views)) view.refresh(); });
const asked = decodeURIComponent(location.hash.slice(1)).split(",").filter((mark) => solids(mark).length);
if (asked.length && views.assembly) choose(asked, { fly: true });

globalThis.report = {  // for scripts beside the page, and its tests
  choose, model, views, explode: explodeTo,
  get state() {
    const { pose, target, distance, explode, shown, flight, atHome } = views.assembly;
    return { azimuth: pose.azimuth, elevation: pose.elevation, target: [...target], distance, explode, shown: [...shown], flying: flight !== undefined, atHome, chosen: [...chosen], hot };
  },
};
