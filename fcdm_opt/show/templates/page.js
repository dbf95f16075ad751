// Draws the figures of the report: the scene, the decision curve, and the numbers that belong to what they show.
// All data are embedded: cases, each with poses and families of frames (see fcdm_opt/show/report/page.py).

const PLOT = { displayModeBar: false, responsive: true, doubleClick: false, scrollZoom: false };
const SCENE = { ...PLOT, scrollZoom: true };

const state = { case: 0, pose: "corrected", family: null, index: 0, zoom: "window", look: null };
let cases = [];
let drawing = null, again = false, hasScene = true, freshView = true;

// ------------------------------------------------------------------------------------------------------ what is shown

const currentCase = () => cases[state.case];
const family = () => state.family && currentCase().families?.[state.family];

/** How the parts are shown: as chosen, else cut open where they hide most of what touches. */
const look = () => state.look ?? (currentCase().scene.cut ? "cut" : "clear");

/** The frame that scene, curve and numbers show: of the slider if it was moved last, else of the pose. */
const currentFrame = () => (family() ? family().frames[state.index] : currentCase().poses[state.pose]);

function chooseCase(number, { remember = true } = {}) {
  state.case = number;
  const { poses, families, file } = currentCase();
  state.pose = ["corrected", "rescaled", "nominal"].find(pose => poses[pose]);
  state.family = null;
  freshView = true;
  for (const section of all("[data-case]")) {
    const chosen = Number(section.dataset.case) === number;
    if (section.tagName === "A") section.toggleAttribute("aria-current", chosen);
    else section.classList.toggle("chosen", chosen);
  }
  const tables = all(".matrix").filter(table => Number(table.dataset.file) === file);
  const own = tables.find(table => table.querySelector(`[data-case="${number}"]`)) ?? tables[0];
  for (const table of all(".matrix")) table.classList.toggle("chosen", table === own);
  element("choose").value = number;
  for (const input of all("input[name=pose]")) input.disabled = !poses[input.value];
  for (const input of all("input[name=family]")) input.disabled = !families?.[input.value];
  markPressed("look", look());
  fillKeys();
  const sliders = ["tolerance", "motion"].filter(name => families?.[name]);
  prepareSlider(sliders.find(name => families[name].frames.length > 1) ?? sliders[0] ?? null);
  if (remember) history.replaceState(null, "", `#case-${number}`);
  show();
}

/** What the star is: goals that track no contact have only a pair of sizes to start from. */
const nominalName = () => (currentCase().tracking ? "tracked point before (nominal)" : "nominal pair");

/** Name the bodies in the keys below the figures, and leave out what this case does not have. */
function fillKeys() {
  if (!element("curve")) return;
  const { bodies, poses, families, nominal, tolerance_box: box, quadrant } = currentCase();
  const frames = [poses, ...Object.values(families ?? {}).map(each => each?.frames ?? [])].flatMap(Object.values);
  element("key-movable").textContent = bodies[0].name;
  element("key-static").textContent = bodies[1].name;
  element("key-keep-out").hidden = bodies.length < 3;
  element("key-overlap").hidden = !poses.rescaled.overlap?.length;
  element("chart").hidden = !box && !poses.tracked && frames.every(frame => !frame || String(frame.target) === String(nominal));
  element("viewer-title").textContent = element("chart").hidden ? "Contact" : "Contact and decision curve";
  for (const id of ["key-before", "key-after"]) element(id).hidden = !frames.some(frame => frame?.transform);
  element("key-snug").hidden = !frames.some(frame => frame?.curve.some(segment => segment[5]));
  element("key-tolerance").hidden = !box;
  element("key-quadrant").hidden = !quadrant;
  element("key-nominal").textContent = nominalName();
  for (const id of ["key-tracked", "now-tracked"]) element(id).hidden = !currentCase().tracking;
}

/** Set the slider to a family's start, the case as asked; without a family it is switched off. */
function prepareSlider(name) {
  if (!element("slider")) return;
  const slider = element("slider"), chosen = name && currentCase().families[name];
  for (const input of all("input[name=family]")) input.checked = input.value === name;
  slider.disabled = !(chosen?.frames.length > 1);
  element("sliders").hidden = !chosen;
  slider.max = chosen ? chosen.frames.length - 1 : 0;
  slider.value = chosen ? chosen.start : 0;
  slider.dataset.family = name ?? "";
  element("slider-name").textContent = chosen ? chosen.label : "no family for this case";
  element("family-note").textContent = chosen?.note ?? "";
  nameSliderValue();
}

function nameSliderValue() {
  const slider = element("slider"), chosen = currentCase().families?.[slider.dataset.family];
  const text = chosen?.shown[slider.value] ?? "";
  element("slider-value").textContent = text;
  slider.setAttribute("aria-valuetext", text);
  slider.setAttribute("aria-label", chosen ? chosen.label : "no family");
}

function slide() {
  const slider = element("slider");
  Object.assign(state, { family: slider.dataset.family, index: Number(slider.value) });
  nameSliderValue();
  show();
}

function show() {
  for (const input of all("input[name=pose]")) input.checked = !state.family && input.value === state.pose;
  showNumbers();
  requestDrawing();
}

// ------------------------------------------------------------------------------------------------------------ numbers

const MOST_TOLD = 8; // contacts that are told in words, and numbered in the picture of the answer

function showNumbers() {
  const frame = currentFrame();
  const write = (id, text) => element(id)?.replaceChildren(text || "\u2013");
  const named = family() ? `${family().label} ${family().shown[state.index]}` : `pose ${poseName()}`;
  write("shown", `Shown: case ${currentCase().name}, ${named}${frame.note ? `: ${frame.note}` : ""}.`);
  write("now-motion", frame.motion);
  write("now-amount", inUnit(digits(frame.amount, 4), currentCase().amount_unit));
  write("now-target", madeAt(frame.target));
  write("now-rho", pair(frame.rho));
  write("now-gap", inUnit(digits(frame.pair_gap, 4), currentCase().unit));
  write("now-state", frame.pair_state);
  write("now-status", (frame.status ?? "").toLowerCase().replaceAll("_", " "));
  const told = [...new Set(featuresOf(frame).map(toldOf))];
  const features = told.slice(0, MOST_TOLD).join("; ") + (told.length > MOST_TOLD ? `; ${told.length - MOST_TOLD} more` : "");
  if (element("chart")) element("now-touching").hidden = !features;
  write("now-features", frame.contact?.length || !features ? features : `nothing here; apart: ${features}`);
}

/** Scales of the parts made where one is scaled, and sizes by name that are off drawn. */
const madeAt = (scales = []) => [
  scales.some(x => x !== 1) ? pair(scales) : "", currentCase().off_drawn,
].filter(Boolean).join("; ") || "as drawn";

/** A number with its unit, alone where there is none. */
const inUnit = (text, unit) => (unit && text !== "\u2013" ? `${text} ${unit}` : text);

const poseName = () => all("input[name=pose]").find(input => input.value === state.pose).parentElement.innerText.trim();

// ------------------------------------------------------------------------------------------------------------ drawing

/** Draw as soon as the last drawing is done; what came in between is left out. */
function requestDrawing() {
  if (drawing) {
    again = true;
    return;
  }
  drawing = (async () => {
    do {
      again = false;
      await new Promise(requestAnimationFrame);
      if (element("chart")?.hidden === false) await drawCurve();
      if (hasScene) await drawScene();
    } while (again);
    drawing = null;
    root.dataset.drawn = [state.case, state.family ?? state.pose, state.family ? state.index : ""].join(" ").trim();
  })();
}

// ----------------------------------------------------------------------------------------------------------- the start

function listen() {
  element("choose").addEventListener("change", event => chooseCase(Number(event.target.value)));
  element("slider")?.addEventListener("input", slide);
  for (const input of all("input[name=pose]")) input.addEventListener("change", () => (Object.assign(state, { pose: input.value, family: null }), show()));
  for (const input of all("input[name=family]")) input.addEventListener("change", () => (prepareSlider(input.value), slide()));
  for (const button of all("[data-turn]")) button.addEventListener("click", () => move(button.dataset.turn));
  for (const button of all("[data-zoom]")) button.addEventListener("click", () => press("zoom", button.dataset.zoom));
  for (const button of all("[data-look]")) button.addEventListener("click", () => press("look", button.dataset.look));
  for (const cell of all("a[data-case]")) {
    cell.addEventListener("click", event => (event.preventDefault(), chooseCase(Number(cell.dataset.case))));
  }
  element("bodies").addEventListener("keydown", event => {
    const name = KEYS[event.key.length === 1 ? event.key.toLowerCase() : event.key];
    if (!name || event.ctrlKey || event.metaKey || event.altKey) return;
    event.preventDefault();
    move(name);
  });
  addEventListener("hashchange", () => {
    const number = caseInAddress();
    if (number !== null) chooseCase(number, { remember: false });
  });
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", show);
  const paper = matchMedia("print");
  paper.addEventListener("change", () => setPrinting(paper.matches));
  addEventListener("beforeprint", () => setPrinting(true));
  addEventListener("afterprint", () => setPrinting(false));
}

/** Choose one of some buttons: part of the curve ("zoom"), or how the parts are shown ("look"). */
function press(kind, name) {
  state[kind] = name;
  markPressed(kind, name);
  requestDrawing();
}

function markPressed(kind, name) {
  for (const button of all(`[data-${kind}]`)) button.setAttribute("aria-pressed", button.dataset[kind] === name);
}

/** On paper: light colours, all folded tables open. */
function setPrinting(starts) {
  root.classList.toggle("printing", starts);
  for (const folded of all("details")) {
    if (starts && !folded.open) folded.dataset.folded = "";
    if (starts) folded.open = true;
    else if ("folded" in folded.dataset) (delete folded.dataset.folded, (folded.open = false));
  }
  if (element("chart")?.hidden === false) drawCurve();
  if (hasScene) drawScene();
}

/** The case that the address names, null where it names none: other links lead to other places of the page. */
function caseInAddress() {
  const number = Number(/^#case-(\d+)$/.exec(location.hash)?.[1] ?? NaN);
  return number < cases.length ? number : null;
}

({ cases } = JSON.parse(await unpacked("packed-figures")));
if (cases.length) {
  loadPlotly(await unpacked("packed-plotly"));
  hasScene = Boolean(document.createElement("canvas").getContext("webgl"));
  element("bodies").hidden = !hasScene;
  element("scene-missing").hidden = hasScene;
  element("viewer").hidden = false;
  root.classList.toggle("drawn", Boolean(element("answers")));
  listen();
  chooseCase(caseInAddress() ?? 0, { remember: false });
  await drawing;
}
root.dataset.ready = "yes";
