// The decision curve before the motion and as shown, with what is asked for.

const SAMPLES = 12; // points of a segment that answer to the pointer
const ROOM = 0.06; // of the window, about what lies outside it

function drawCurve() {
  const shown = currentCase(), frame = currentFrame(), colours = palette();
  const before = shown.poses.nominal, moved = frame.transform != null;
  const traces = [
    ...curveTraces("before", before, "solid", colours.movable, colours),
    ...(moved ? curveTraces("after", frame, "dash", colours.static, colours) : []),
    marks(nominalName(), [shown.nominal], "star", 15, colours.ink, colours.ink),
    marks("parts made", [frame.target], "diamond-open", 12, colours.good, "none"),
    moved && shown.tracking ? marks("tracked point after", [frame.rho], "circle-open", 17, colours.static, "none") : null,
  ].filter(Boolean);
  const [x, y] = state.zoom === "window" ? windowOf(shown, frame) : shown.axes.box;
  const axis = (title, range) => ({
    title: { text: title, standoff: 10 }, range, zeroline: false, gridcolor: colours.grid, linecolor: colours.muted,
    tickcolor: colours.muted, ticks: "outside", showline: true, mirror: true, nticks: 7, automargin: true,
  });
  const layout = {
    uirevision: `${state.case} ${state.zoom}`,
    margin: { l: 8, r: 10, t: 8, b: 8 },
    paper_bgcolor: "rgba(0,0,0,0)", plot_bgcolor: colours.paper,
    font: { family: FONT, size: 13, color: colours.ink },
    xaxis: axis("\u03c1<sub>1</sub>, size of the movable part", x),
    yaxis: axis("\u03c1<sub>2</sub>, size of the static part", y),
    showlegend: false, hovermode: "closest", hoverlabel: hoverStyle(colours), dragmode: "pan",
    shapes: areas(shown, frame, colours),
  };
  return Plotly.react("curve", traces, layout, PLOT);
}

/** The window about the tolerance box, wider where the frame's own box or pairs lie outside. */
function windowOf(shown, frame) {
  const seen = [frame.target, frame.rho, ...transposed(toleranceBox(shown, frame))].filter(Boolean);
  return shown.axes.window.map((side, k) => {
    const low = Math.min(...seen.map(own => own[k])), high = Math.max(...seen.map(own => own[k]));
    const margin = ROOM * (Math.max(high, side[1]) - Math.min(low, side[0]));
    return [low < side[0] ? low - margin : side[0], high > side[1] ? high + margin : side[1]];
  });
}

/** Sides of the tolerance box, as large as the frame's tolerance; nothing where there is none. */
function toleranceBox(shown, frame) {
  const { nominal, tolerance_box: box } = shown, made = frame.target ?? nominal;
  const start = shown.poses.rescaled?.target ?? made;
  return box?.map((side, k) => {
    const share = start[k] === nominal[k] ? 1 : (made[k] - nominal[k]) / (start[k] - nominal[k]);
    return side.map(end => nominal[k] + share * (end - nominal[k]));
  });
}

const transposed = box => (box ? [0, 1].map(end => box.map(side => side[end])) : []);

/** A curve's line, with its snug pieces and switching points. */
function curveTraces(name, frame, dash, colour, colours) {
  const line = { x: [], y: [], text: [] }, snug = { x: [], y: [] };
  for (const [x1, y1, x2, y2, label, isSnug] of frame.curve) {
    const text = segmentText(name, x1, y1, x2, y2, currentCase().labels[label], isSnug);
    for (let k = 0; k <= SAMPLES; k++) {
      const t = k / SAMPLES;
      line.x.push(x1 + t * (x2 - x1));
      line.y.push(y1 + t * (y2 - y1));
      line.text.push(text);
    }
    if (isSnug) (snug.x.push(x1, x2, null), snug.y.push(y1, y2, null));
    (line.x.push(null), line.y.push(null), line.text.push(""));
  }
  const points = frame.switching ?? [];
  return [
    {
      type: "scatter", mode: "lines", name: `${name}, snug`, hoverinfo: "skip", ...snug,
      line: { color: colours.snug, width: 9 },
    },
    {
      type: "scatter", mode: "lines", name, hoverinfo: "text", ...line, connectgaps: false,
      line: { color: colour, width: 2.2, dash: dash === "dash" ? "7px,3px" : dash },
    },
    {
      type: "scatter", mode: "markers", name: `${name}, switching points`, hoverinfo: "text",
      x: points.map(p => p[0]), y: points.map(p => p[1]),
      text: points.map(([px, py, index]) => `${plain(index)} ${name}<br>${pair([px, py])}`),
      marker: { size: 7, color: colour },
    },
  ];
}

/** What a segment says under the pointer: its feature, and its line as a unit normal gives it. */
function segmentText(name, x1, y1, x2, y2, label, isSnug) {
  const length = Math.hypot(x2 - x1, y2 - y1) || 1;
  let [a, b] = [(y1 - y2) / length, (x2 - x1) / length];
  if (a + b < 0) [a, b] = [-a, -b];
  const sign = b < 0 ? "\u2212" : "+", c = digits(a * x1 + b * y1);
  const equation = `${digits(a, 5)} \u03c1<sub>1</sub> ${sign} ${digits(Math.abs(b), 5)} \u03c1<sub>2</sub> = ${c}`;
  return `${name}${isSnug ? ", snug" : ""}<br><b>${plain(label)}</b><br>${equation}`;
}

function marks(name, points, symbol, size, colour, fill) {
  const [point] = points;
  if (!point) return null;
  return {
    type: "scatter", mode: "markers", name, x: [point[0]], y: [point[1]], hoverinfo: "text",
    text: [`${name}<br>${pair(point)}`],
    marker: { symbol, size, color: colour, line: { width: fill === "none" ? 2.5 : 1, color: colour } },
  };
}

/** Tolerance box, reaching to the pair made where the slider moves it, and the quadrant asked for. */
function areas(shown, frame, colours) {
  const { nominal, signs, quadrant } = shown, made = frame.target ?? nominal;
  const shapes = [], rectangle = (x, y, look) => shapes.push({
    type: "rect", layer: "below", x0: x[0], x1: x[1], y0: y[0], y1: y[1], line: { width: 0 }, ...look,
  });
  if (quadrant && signs && frame.target) {
    const [x, y] = [0, 1].map(k => [made[k], signs[k] > 0 ? shown.axes.box[k][1] * 2 : 0]);
    rectangle(x, y, { fillcolor: colours.good, opacity: 0.13, name: "asked for" });
  }
  const box = toleranceBox(shown, frame);
  if (box) rectangle(...box, { fillcolor: colours.muted, opacity: 0.22, name: "tolerance box" });
  return shapes;
}
