// A study's points: chosen columns against each other, and one point at a time in full.

const SYMBOLS = ["circle", "square", "diamond", "triangle-up", "triangle-down", "star", "hexagon", "pentagon"];
const COLOURS = ["movable", "static", "good", "violet", "amber", "ink"];
const NO_MOTION = "x-thin-open", NO_ANSWER = "cross-thin-open";
const MOST_SERIES = 12; // values of a column that tells lines apart
const NOTHING = "nothing";
const EDGE = 0.025; // of the height: where points without a value stand

let study, moving = false;

/** What a column is called. */
const called = name => study.words[name] ?? name;

/** Values of a column, in the order of the points. */
const column = name => study.rows.map(row => row[study.columns.indexOf(name)]);
const isNumeric = name => column(name).some(value => typeof value === "number");
const distinct = name => [...new Set(column(name).map(value => JSON.stringify(value)))];

/** What a value reads as: numbers with six digits, texts as they are. */
const reads = value => (typeof value === "number" ? digits(value) : value == null || value === "" ? "\u2013" : String(value));

function fillChoices() {
  const numeric = study.columns.filter(isNumeric);
  const varied = study.varied.filter(name => numeric.includes(name) && name !== "draw");
  const longest = [...varied].sort((one, two) => distinct(two).length - distinct(one).length)[0];
  choices("x-axis", [...new Set([...study.varied, ...numeric])], longest ?? study.varied[0] ?? numeric[0]);
  choices("y-axis", [...new Set(["amount", ...numeric])], "amount");
  const few = study.columns.filter(name => distinct(name).length > 1 && distinct(name).length <= MOST_SERIES);
  const others = few.filter(name => name !== longest);
  choices("series", [NOTHING, ...others], others.find(name => study.varied.includes(name)) ?? NOTHING);
}

function choices(id, names, chosen) {
  const select = element(id);
  for (const name of names) select.append(new Option(called(name), name, name === chosen, name === chosen));
  select.addEventListener("change", draw);
}

/** Points in groups: by what tells them apart, and by whether their motion is usable. */
function groups() {
  const name = element("series").value;
  const values = name === NOTHING ? study.rows.map(() => "") : column(name).map(value => JSON.stringify(value));
  const found = [...new Set(values)];
  return found.map((value, k) => ({
    name: value === "" ? "usable motion" : `${called(name)}: ${reads(JSON.parse(value))}`,
    colour: COLOURS[k % COLOURS.length],
    symbol: SYMBOLS[k % SYMBOLS.length],
    places: values.flatMap((own, place) => (own === value ? [place] : [])),
  }));
}

/** What the horizontal axis shows of each point: numbers, or texts side by side. */
const acrossOf = name => (isNumeric(name) ? column(name) : column(name).map(value => plain(shortened(reads(value)))));

function draw() {
  const colours = palette(), across = element("x-axis").value, up = element("y-axis").value;
  const x = acrossOf(across), y = column(up);
  const isOrdered = study.varied.includes(across) && isNumeric(across);
  const traces = groups().flatMap(group => {
    const drawn = places => ({
      type: "scatter", name: group.name,
      x: places.map(place => x[place]), y: places.map(place => y[place]), customdata: places,
      text: places.map(hover), hoverinfo: "text",
    });
    const good = group.places.filter(place => study.usable[place]);
    const [known, unknown] = [true, false].map(has => group.places.filter(place => !study.usable[place] && (y[place] != null) === has));
    const lines = isOrdered && isLine(good.map(place => x[place]));
    return [
      {
        ...drawn(good), mode: lines ? "lines+markers" : "markers", line: { color: colours[group.colour], width: 1.6 },
        marker: { size: 6, symbol: group.symbol, color: colours[group.colour] },
      },
      { ...drawn(known), mode: "markers", marker: failed(colours[group.colour], known) },
      { ...drawn(unknown), mode: "markers", marker: failed(colours[group.colour], unknown), y: unknown.map(() => EDGE), yaxis: "y2" },
    ];
  });
  traces.push({
    type: "scatter", mode: "markers", name: "chosen point", hoverinfo: "skip", ...chosenPlace(),
    marker: { size: 17, symbol: "circle-open", color: colours.ink, line: { width: 2.5, color: colours.ink } },
  });
  const axis = title => ({
    title: { text: plain(title), standoff: 10 }, zeroline: false, gridcolor: colours.grid, linecolor: colours.muted,
    tickcolor: colours.muted, ticks: "outside", showline: true, mirror: true, automargin: true, exponentformat: "power",
  });
  const shapes = up === "amount" && study.budget != null ? [{
    type: "line", xref: "paper", x0: 0, x1: 1, y0: study.budget, y1: study.budget,
    line: { color: colours.quiet, width: 1.5, dash: "dot" },
    label: { text: `budget ${digits(study.budget)} ${study.unit}`, textposition: "start", font: { size: 12, color: colours.quiet } },
  }] : [];
  Plotly.react("chart", traces, {
    uirevision: `${across} ${up}`, margin: { l: 8, r: 10, t: 8, b: 8 }, paper_bgcolor: "rgba(0,0,0,0)", plot_bgcolor: colours.paper,
    font: { family: FONT, size: 13, color: colours.ink },
    xaxis: { ...axis(called(across)), type: isNumeric(across) ? "linear" : "category" },
    yaxis: axis(called(up)), showlegend: false, hovermode: "closest",
    yaxis2: { overlaying: "y", range: [0, 1], visible: false, fixedrange: true },
    hoverlabel: hoverStyle(colours), dragmode: "pan", shapes,
  }, { displayModeBar: false, responsive: true, doubleClick: "reset", scrollZoom: false });
  fillKey();
  tellDrawn();
}

const tellDrawn = () => (root.dataset.drawn = ["x-axis", "y-axis", "series", "slider"].map(id => element(id).value).join("|"));

/** Where the ring about the chosen point stands: on the lower edge where the point has no value. */
function chosenPlace() {
  const place = Number(element("slider").value), y = column(element("y-axis").value)[place];
  return { x: [acrossOf(element("x-axis").value)[place]], y: [y ?? EDGE], yaxis: y == null ? "y2" : "y" };
}

/** Move the ring only, once a frame: with thousands of points one drawing takes longer than a step of the slider. */
function moveRing() {
  if (moving) return;
  moving = true;
  requestAnimationFrame(() => {
    moving = false;
    const { x, y, yaxis } = chosenPlace();
    Plotly.restyle("chart", { x: [x], y: [y], yaxis }, [element("chart").data.length - 1]);
    tellDrawn();
  });
}

const statusOf = place => study.rows[place][study.columns.indexOf("status")];
const isAnswered = place => !(statusOf(place) in study.unanswered);

/** The marks of points without a usable motion; where there is nothing to draw one at, it stands on the lower edge. */
const failed = (colour, places) => ({
  size: 9, symbol: places.map(place => (isAnswered(place) ? NO_MOTION : NO_ANSWER)), color: colour, line: { width: 2, color: colour },
});

/** Whether values rise or fall all the way, so that a line through them says something. */
const isLine = values => values.length > 1 && (values.every((value, k) => !k || value > values[k - 1]) || values.every((value, k) => !k || value < values[k - 1]));

function fillKey() {
  const marks = { circle: "\u25cf", square: "\u25a0", diamond: "\u25c6", "triangle-up": "\u25b2", "triangle-down": "\u25bc", star: "\u2605", hexagon: "\u2b22", pentagon: "\u2b1f" };
  const items = groups().map(group => [marks[group.symbol], group.name, `c-${group.colour}`]);
  if (study.usable.some((usable, place) => !usable && isAnswered(place))) items.push(["\u2715", "no usable motion", "c-ink"]);
  if (!study.rows.every((_, place) => isAnswered(place))) items.push(["+", "without an answer", "c-ink"]);
  items.push(["\u25ef", "chosen with the slider", "c-ink"]);
  if (study.of > study.rows.length) items.push(["", `${study.rows.length} of ${study.of} points, evenly chosen`, "c-ink"]);
  element("key").replaceChildren(...items.map(([mark, words, kind]) => {
    const item = document.createElement("li"), sign = document.createElement("i");
    sign.className = kind;
    sign.textContent = mark;
    item.append(sign, words);
    return item;
  }));
}

const hover = place => [...study.varied, "status", "amount", ...(study.usable[place] ? [] : ["message"])]
  .map(name => `${plain(called(name))}: ${plain(shortened(reads(study.rows[place][study.columns.indexOf(name)])))}`).join("<br>");
const shortened = text => (text.length > 60 ? `${text.slice(0, 57)}...` : text);

/** A bound to six digits, never more than it is. */
function floored(bound) {
  if (!(bound > 0)) return bound;
  const places = 5 - Math.floor(Math.log10(bound)), down = Math.floor(bound * 10 ** places * (1 + 1e-11)) / 10 ** places;
  return Number.isFinite(down) ? down : bound;
}

/** Show the chosen point in full. */
function showPoint() {
  const place = Number(element("slider").value), row = study.rows[place];
  const where = `${place + 1} of ${study.rows.length}`;
  element("slider-value").textContent = where;
  element("slider").setAttribute("aria-valuetext", where);
  const told = [["number in study.csv", study.numbers[place]], ...study.columns.map((name, k) => [name, row[k]])];
  element("now").replaceChildren(...told.map(([name, found]) => {
    const item = document.createElement("div"), term = document.createElement("dt"), value = document.createElement("dd");
    term.textContent = called(name);
    value.textContent = reads(name === "lower_bound" ? floored(found) : found);
    if (value.textContent.length > 40) item.className = "wide";
    item.append(term, value);
    return item;
  }));
}

function choosePoint(place) {
  element("slider").value = place;
  showPoint();
  moveRing();
}

study = JSON.parse(await unpacked("packed-figures"));
if (study.rows.length) {
  loadPlotly(await unpacked("packed-plotly"));
  element("viewer").hidden = false;
  root.classList.add("drawn");
  element("slider").max = study.rows.length - 1;
  fillChoices();
  showPoint();
  draw();
  element("slider").addEventListener("input", () => choosePoint(Number(element("slider").value)));
  element("chart").on("plotly_click", event => event.points[0].customdata != null && choosePoint(event.points[0].customdata));
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", draw);
}
root.dataset.ready = "yes";
