// The bodies in space, their features in contact, and from where they are seen.

const VIEW_SIZE = 2.1; // of the scene: the bodies' diagonal in units of the view, which is 2 high
const FILLED = 0.9; // share of the view that the bodies fill at first
const TURN = Math.PI / 18, ZOOM = 1.25, STEEPEST = Math.PI / 24;
const FAR = 8; // of the camera, in units of the view
const NEAR = 3; // how much "to the contact" enlarges

const minus = (p, q) => p.map((x, k) => x - q[k]);
const dot = (p, q) => p.reduce((sum, x, k) => sum + x * q[k], 0);
const cross = ([a, b, c], [d, e, f]) => [b * f - c * e, c * d - a * f, a * e - b * d];
const norm = p => Math.hypot(...p);
const unit = p => p.map(x => x / (norm(p) || 1));
const NOTHING = [Infinity, -Infinity], wider = ([low, high], x) => [Math.min(low, x), Math.max(high, x)];
const middle = points => [0, 1, 2].map(k => points.reduce((sum, p) => sum + p[k], 0) / points.length);

const seedOf = body => currentCase().scene.objects.find(object => object.body === body).seed;

/** The motion of a body, of two parts or of several. */
const transformOf = (body, frame) => (frame.transforms ?? [frame.transform])[body];

/** Where a frame puts points of a body: scaled about its seed, the movable body then moved. */
function placed(points, body, frame) {
  const seed = seedOf(body);
  const size = frame.sizes[body] ?? 1, T = transformOf(body, frame);
  return points.map(point => {
    const p = point.map((x, k) => seed[k] + size * (x - seed[k]));
    return T ? [0, 4, 8].map(row => T[row] * p[0] + T[row + 1] * p[1] + T[row + 2] * p[2] + T[row + 3]) : p;
  });
}

const corners = triangles => ({ i: triangles.map(t => t[0]), j: triangles.map(t => t[1]), k: triangles.map(t => t[2]) });
/** A little smaller about the middle: faces that lie in another body's faces would flicker. */
function shrunk(points) {
  const centre = middle(points), most = 0.004 * extent().size;
  return points.map(p => p.map((x, k) => x - Math.sign(x - centre[k]) * Math.min(most, Math.abs(x - centre[k]) / 2)));
}
const columns = points => ({ x: points.map(p => p[0]), y: points.map(p => p[1]), z: points.map(p => p[2]) });
const lines = (points, edges) => columns(edges.flatMap(([i, j]) => [points[i], points[j], [null, null, null]]));
const LIGHT = { facenormalsepsilon: 0, vertexnormalsepsilon: 0, ambient: 0.8, diffuse: 0.35, specular: 0, roughness: 1, fresnel: 0 };
/** A colour with so much of the ground in it as in the key, or nearly: edges and what touches stand out from it. */
const tinted = (colour, ground, share = 0.3) => `#${[1, 3, 5].map(k => {
  const [own, other] = [colour, ground].map(hex => parseInt(hex.slice(k, k + 2), 16));
  return Math.round(own + share * (other - own)).toString(16).padStart(2, "0");
}).join("")}`;

/** Points so near to the reader that what is beside them hides no part of their rings; before a section there is nothing. */
const broughtForward = (points, { eye, center }, plane) => points.flatMap(p => lifted([p],
  { facing: unit(minus(values(eye), values(center))) }, plane && dot(plane.facing, p) > plane.level - 2e-3 * extent().size ? 0.18 : 0.08));

function drawScene() {
  const frame = currentFrame(), colours = palette(), gd = element("bodies"), plane = look() === "cut" ? sectionPlane() : null;
  const traces = [
    ...bodyTraces(frame, colours, plane), ...before(frame, colours, plane), ...featureTraces(frame, colours, plane), ...areaTraces(frame, colours, plane),
    ...overlapTraces(frame, colours),
    ...triad(colours),
  ];
  const known = (frame.contacts ?? []).map((at, k) => ({ at, name: frame.contact ? toldOf(frame.contact[k]) : k }));
  const left = known.filter(({ at }) => !plane || dot(plane.facing, at) <= plane.level), names = left.map(({ name }) => name);
  const seen = left.filter(({ name }, k) => names.indexOf(name) === k).map(({ at }) => at); // of facets of one face the first
  const view = freshView || !gd.layout?.scene ? firstView() : currentView();
  freshView = false;
  if (seen.length) {
    const ring = { symbol: "circle-open", size: 13, color: colours.ink, line: { width: 3, color: colours.ink } };
    traces.push({
      type: "scatter3d", mode: "markers", name: "contact", ...columns(broughtForward(seen, view.camera, plane)), marker: ring,
      hoverinfo: "text", text: seen.map(p => `contact point<br>${pair(p)}`),
    });
  }
  const axis = k => ({ visible: false, range: extent().range[k], autorange: false, showspikes: false });
  const layout = {
    margin: { l: 0, r: 0, t: 0, b: 0 }, paper_bgcolor: "rgba(0,0,0,0)", showlegend: false,
    font: { family: FONT, size: 13, color: colours.ink }, hoverlabel: hoverStyle(colours),
    scene: {
      xaxis: axis(0), yaxis: axis(1), zaxis: axis(2), aspectmode: "manual", dragmode: "turntable", ...view,
    },
  };
  gd.setAttribute("aria-label", `Scene in three dimensions. ${element("shown").textContent}`);
  const drawn = Plotly.react(gd, traces, layout, SCENE);
  gd.removeAllListeners("plotly_relayout");
  gd.on("plotly_relayout", () => {
    const { x, y, z } = columns(broughtForward(seen, currentView().camera, plane)), at = traces.findIndex(trace => trace.name === "contact");
    if (at >= 0) Plotly.restyle(gd, { x: [x], y: [y], z: [z] }, [at]);
  });
  return drawn;
}

function bodyTraces(frame, colours, plane) {
  const clear = look() === "clear";
  return currentCase().scene.objects.flatMap(object => {
    const { role } = object, part = role !== "keep-out", colour = object.colour ?? colours[part ? role : "muted"];
    const opacity = !part ? 0.2 : !clear ? 1 : role === "movable" ? 0.5 : 0.2, whole = placed(object.points, object.body, frame);
    const cut = plane && part;
    const { points, triangles, edges } = cut ? cutOpen(whole, object, plane) : { ...object, points: whole };
    const solid = columns(part ? points : shrunk(points));
    const name = plain(object.name);
    const [seed] = placed([object.seed], object.body, frame);
    return [
      {
        type: "mesh3d", name: role, ...solid, ...corners(triangles), color: tinted(colour, colours.paper), opacity, flatshading: true,
        lighting: LIGHT,
        hoverinfo: "text", text: points.map(p => `${name}, ${role}<br>corner ${pair(p)}`),
      },
      {
        type: "scatter3d", mode: "lines", name: `${role} edges`, ...lines(points, edges), hoverinfo: "skip",
        line: { color: part ? colours.ink : colour, width: 2.5 },
      },
      ...(!clear ? [] : [{ // inside a solid it would stick out in pieces
        type: "scatter3d", mode: "markers", name: `${role} seed`, ...columns([seed]),
        marker: { symbol: "cross", size: 5, color: colour }, hoverinfo: "text", text: [`seed of ${name}`],
      }]),
    ];
  });
}

/** Where the parts are cut open: through the middle of the contact at which the plane meets most of them, across it, so that
    what stands before it on first view is gone. */
function sectionPlane() {
  const facing = currentCase().scene.section, small = 1e-6 * extent().size, contacts = contactsNear();
  const ends = contacts.map((p, k) => [p, ...(touchingFrame()?.shares[k].flat() ?? [])].map(q => dot(facing, q)).reduce(wider, NOTHING));
  const levels = ends.map(([lo, hi]) => (lo + hi) / 2);
  const met = levels.map(level => ends.filter(([lo, hi]) => lo <= level + small && level <= hi + small).length);
  return { facing, level: levels[met.indexOf(Math.max(...met))] + small };
}

/** What of a body is behind a plane, cut there and closed by the section; all of one that is wholly before it. What is
    not `closed`, such as an area, is only cut. */
function cutOpen(points, { triangles, edges }, { facing, level }, closed = true) {
  const heights = points.map(p => dot(facing, p) - level), kept = [...points], rim = [], behind = [], left = [];
  if (closed && heights.every(height => height > -1e-3 * extent().size)) return { points, triangles, edges };
  const between = (i, j) => {
    const share = heights[i] / (heights[i] - heights[j]);
    return kept.push(points[i].map((x, k) => x + share * (points[j][k] - x))) - 1;
  };
  for (const triangle of triangles) {
    const start = triangle.findIndex((i, k) => heights[i] <= 0 && heights[triangle[(k + 2) % 3]] > 0);
    if (start < 0) {
      if (triangle.every(i => heights[i] <= 0)) behind.push(triangle);
      continue;
    }
    const [a, b, c] = [0, 1, 2].map(k => triangle[(start + k) % 3]), out = between(a, c);
    const into = heights[b] <= 0 ? between(b, c) : between(a, b);
    behind.push(...(heights[b] <= 0 ? [[a, b, into], [a, into, out]] : [[a, into, out]]));
    rim.push([into, out]);
  }
  for (const [i, j] of edges) {
    if (heights[i] > 0 && heights[j] > 0) continue;
    left.push(heights[i] > 0 ? [between(i, j), j] : heights[j] > 0 ? [i, between(i, j)] : [i, j]);
  }
  const marks = lifted(kept.slice(points.length), { facing });
  return { points: kept, triangles: [...behind, ...(closed ? filled(kept, rim, facing) : [])], edges: [...left, ...rim], marks,
    across: rim.map(own => own.map(k => k - points.length)) };
}

/** Points a little before a section, which would hide half of their marks; the more, the larger these are. */
const lifted = (points, { facing }, by = 0.004) => points.map(p => p.map((x, k) => x + by * extent().size * facing[k]));

/** Triangles of the areas within outlines that lie in a plane, by strips between neighbouring corners. */
function filled(points, outlines, facing) {
  const u = unit(cross(facing, Math.abs(facing[2]) > 0.9 ? [1, 0, 0] : [0, 0, 1])), v = cross(facing, u), made = [];
  const flat = outlines.map(ends => ends.map(i => [dot(u, points[i]), dot(v, points[i])]).sort((p, q) => p[0] - q[0]));
  if (!flat.length) return made;
  const off = dot(facing, points[outlines[0][0]]), places = [...new Set(flat.flat().map(p => p[0]))].sort((x, y) => x - y);
  const add = (x, y) => points.push([0, 1, 2].map(k => x * u[k] + y * v[k] + off * facing[k])) - 1;
  for (let k = 0; k + 1 < places.length; k++) {
    const [x0, x1] = [places[k], places[k + 1]];
    const across = flat.filter(([p, q]) => p[0] <= x0 && q[0] >= x1);
    const at = ([p, q], x) => p[1] + ((x - p[0]) / (q[0] - p[0])) * (q[1] - p[1]);
    across.sort((s, t) => at(s, x0) + at(s, x1) - at(t, x0) - at(t, x1));
    for (let n = 0; n + 1 < across.length; n += 2) {
      const [a, b, c, d] = [[n, x0], [n, x1], [n + 1, x1], [n + 1, x0]].map(([m, x]) => add(x, at(across[m], x)));
      made.push([a, b, c], [a, c, d]);
    }
  }
  return made;
}

/** The old places of what moved, in dashes. */
function before(frame, colours, plane) {
  return currentCase().scene.objects.filter(({ body }) => transformOf(body, frame)).map(object => {
    const whole = placed(object.points, object.body, { sizes: frame.sizes }), drawn = { triangles: [], edges: object.edges };
    const { points, edges } = plane ? cutOpen(whole, drawn, plane, false) : { points: whole, edges: object.edges };
    return {
      type: "scatter3d", mode: "lines", name: "before the motion", hoverinfo: "skip", ...lines(points, edges),
      line: { color: object.colour ?? colours.movable, width: 2, dash: "dash" },
    };
  });
}

/** Where the parts made overlap: a surface of triangles, which the see-through parts do not hide. */
function overlapTraces(frame, colours) {
  const points = frame.overlap ?? [], rows = points.filter((_, k) => k % 3 === 0).map((_, k) => [3 * k, 3 * k + 1, 3 * k + 2]);
  return points.length ? [{
    type: "mesh3d", name: "overlap", ...columns(points), ...corners(rows), color: colours.violet, flatshading: true,
    lighting: { ambient: 0.9, diffuse: 0.1 }, hoverinfo: "text", text: points.map(() => "where the parts made overlap"),
  }] : [];
}

const areasOf = frame => (frame.shares ?? []).flat().filter(points => points.length > 1);

/** What both bodies share: areas and lines, not all of the faces that touch; without edges within an area. */
function areaTraces(frame, colours, plane) {
  const areas = areasOf(frame);
  return areas.flatMap((corner, k) => {
    const fan = corner.slice(2).map((_, n) => [0, n + 1, n + 2]), outline = rims(areas, k), count = corner.length;
    const whole = { triangles: fan, edges: outline.map((_, n) => [count + 2 * n, count + 2 * n + 1]) };
    const all = [...corner, ...outline.flat()];
    const { points, triangles, edges, marks, across } = plane ? cutOpen(all, whole, plane, false) : { points: all, ...whole };
    const traces = [{
      type: "scatter3d", mode: "lines", name: "contact area", hoverinfo: "skip", ...lines(points, edges),
      line: { color: colours.good, width: 6 },
    }, ...cutMarks(marks, across, colours)];
    if (triangles.length) {
      traces.push({
        type: "mesh3d", name: "contact area", ...columns(points), ...corners(triangles), color: colours.good, opacity: 0.6,
        flatshading: true, lighting: { ambient: 1, diffuse: 0 }, hoverinfo: "skip",
      });
    }
    return traces;
  });
}

/** Where a section goes through what touches: lines across areas, points of lines. */
function cutMarks(marks, across, colours) {
  if (!marks?.length) return [];
  const look = { type: "scatter3d", name: "contact, cut", hoverinfo: "skip" }, paint = { color: colours.good };
  return across.length
    ? [{ ...look, mode: "lines", ...lines(marks, across), line: { ...paint, width: 9 } }]
    : [{ ...look, mode: "markers", ...columns(marks), marker: { ...paint, size: 7, line: { color: colours.paper, width: 1 } } }];
}

/** The outline of one of several areas, without what it has in common with others on the other side of it. */
function rims(areas, own) {
  const near = 1e-6 * extent().size, sides = points => points.map((p, k) => [p, points[(k + 1) % points.length]]);
  if (areas[own].length < 3) return [areas[own]];
  const others = areas.filter((points, k) => k !== own && points.length > 2);
  return sides(areas[own]).flatMap(([a, b]) => {
    const long = norm(minus(b, a)), way = unit(minus(b, a)), along = p => dot(minus(p, a), way);
    const off = p => minus(minus(p, a), way.map(x => x * along(p)));
    const inward = off(middle(areas[own])), ends = [[0, 0]];
    for (const points of others) {
      if (dot(off(middle(points)), inward) >= 0) continue;
      for (const side of sides(points)) {
        if (side.some(p => norm(off(p)) > near)) continue;
        const [low, high] = side.map(along).sort((x, y) => x - y);
        if (high > near && low < long - near) ends.push([Math.max(low, 0), Math.min(high, long)]);
      }
    }
    ends.sort((x, y) => x[0] - y[0]);
    const at = t => a.map((x, k) => x + t * way[k]), left = [];
    let done = 0;
    for (const [low, high] of [...ends, [long, long]]) {
      if (low > done + near) left.push([at(done), at(low)]);
      done = Math.max(done, high);
    }
    return left;
  });
}

/** Features in contact, or where there is none those that are tracked. */
function featuresOf(frame) {
  if (frame.contact?.length) return frame.contact;
  return (frame.transform && currentCase().poses.tracked?.contact) || [];
}

const toldOf = k => currentCase().feature_shapes[k].shapes.map(shape => shape.name).join(", ");
const shapesOf = frame => featuresOf(frame).flatMap(k => currentCase().feature_shapes[k].shapes);

/** Edges of only one of some triangles: the outline of what they make up. */
function rim(triangles) {
  const edges = triangles.flatMap(([i, j, k]) => [[i, j], [j, k], [k, i]]), count = new Map();
  const key = ([i, j]) => `${Math.min(i, j)} ${Math.max(i, j)}`;
  for (const edge of edges) count.set(key(edge), (count.get(key(edge)) ?? 0) + 1);
  return edges.filter(edge => count.get(key(edge)) === 1);
}

/** The features in contact, in green. */
function featureTraces(frame, colours, plane) {
  const drawn = shapesOf(frame).filter(shape => shape.kind !== "F" || !areasOf(frame).length);
  return drawn.flatMap(shape => {
    const whole = placed(shape.points, shape.body, frame), text = plain(shape.name), name = `feature ${text}`;
    const drawn = { triangles: shape.triangles ?? [], edges: shape.kind === "E" ? [[0, 1]] : rim(shape.triangles ?? []) };
    const { points, triangles, edges: edge, marks, across } = plane && shape.kind !== "V" ? cutOpen(whole, drawn, plane, false)
      : { points: whole.filter(p => !plane || dot(plane.facing, p) <= plane.level), triangles: drawn.triangles, edges: drawn.edges };
    const outline = shape.kind === "V" ? { mode: "markers", ...columns(points) } : { mode: "lines", ...lines(points, edge) };
    const traces = [{
      type: "scatter3d", name, hoverinfo: "text", text, ...outline,
      line: { color: colours.good, width: shape.kind === "E" ? 8 : 4 }, marker: { size: 6, color: colours.good },
    }, ...cutMarks(marks, across, colours)];
    if (triangles.length) {
      traces.push({
        type: "mesh3d", name, ...columns(points), ...corners(triangles), color: colours.good, opacity: 0.4,
        flatshading: true, lighting: { ambient: 1, diffuse: 0 }, hoverinfo: "text", text: points.map(() => text),
      });
    }
    return traces;
  });
}

/** Where the directions x, y, z are drawn, below the corner that nothing hides on first view: their start, and their ends. */
function triadPoints() {
  const { box, size } = extent(), length = 0.13 * size, behind = currentCase().scene.view[1] > 0;
  const at = box.map(([lo, hi], k) => (k === 2 ? lo - 1.1 * length : behind ? hi + 0.4 * length : lo - 0.4 * length));
  return [at, ...[0, 1, 2].map(k => at.map((x, j) => x + (j === k ? length : 0)))];
}

function triad(colours) {
  const [at, ...ends] = triadPoints();
  const font = { family: FONT, size: 12, color: colours.quiet };
  return [
    {
      type: "scatter3d", mode: "lines", name: "axes", ...lines([at, ...ends], [[0, 1], [0, 2], [0, 3]]),
      hoverinfo: "skip", line: { color: colours.quiet, width: 3 },
    },
    {
      type: "scatter3d", mode: "text", name: "axis names", ...columns(ends), text: ["x", "y", "z"], textfont: font,
      hoverinfo: "skip",
    },
  ];
}

/** Box of the poses, which the first view fits, and the range of all frames, which nothing leaves. */
function extent() {
  const shown = currentCase();
  if (shown.extent) return shown.extent;
  const all = frame => shown.scene.objects.flatMap(object => placed(object.points, object.body, frame));
  const reached = frames => frames.filter(Boolean).flatMap(all);
  const bounds = points => [0, 1, 2].map(k => points.reduce((found, p) => wider(found, p[k]), NOTHING));
  const points = reached(Object.values(shown.poses)), box = bounds(points);
  const size = norm(box.map(([lo, hi]) => hi - lo));
  const families = Object.values(shown.families ?? {}).filter(Boolean).flatMap(each => each.frames);
  const every = families.length ? bounds(reached(families)) : box;
  const range = box.map(([lo, hi], k) => [Math.min(lo, every[k][0]) - 0.2 * size, Math.max(hi, every[k][1]) + 0.2 * size]);
  return (shown.extent = { points, box, middle: box.map(([lo, hi]) => (lo + hi) / 2), size, range });
}

// --------------------------------------------------------------------------------------------------- view of the scene

const xyz = ([x, y, z]) => ({ x, y, z });
const values = ({ x, y, z }) => [x, y, z];

/** A point of the scene in units of the view at a zoom. */
function inView(point, zoom) {
  const { range, size } = extent();
  return point.map((x, k) => ((x - (range[k][0] + range[k][1]) / 2) * VIEW_SIZE * zoom) / size);
}

function viewOf(eye, up, focus, zoom) {
  const { range, size } = extent(), target = inView(focus, zoom);
  const camera = {
    projection: { type: "orthographic" }, up: xyz(up), center: xyz(target),
    eye: xyz(unit(eye).map((x, k) => FAR * x + target[k])),
  };
  return { camera, aspectratio: xyz(range.map(([lo, hi]) => ((hi - lo) * VIEW_SIZE * zoom) / size)) };
}

/** From where the contact is seen, the same for all cases of a pair; all of the poses fills the frame. */
function firstView() {
  const [up, turn] = currentCase().scene.view.map(x => (x * Math.PI) / 180), { points, size } = extent();
  const eye = [Math.cos(up) * Math.cos(turn), Math.cos(up) * Math.sin(turn), Math.sin(up)];
  const right = [-Math.sin(turn), Math.cos(turn), 0], page = [right, cross(eye, right), eye], shown = [...points, ...triadPoints()];
  const ends = page.map(way => shown.map(p => dot(way, p)).reduce(wider, NOTHING)), { clientWidth, clientHeight } = element("bodies");
  const [wide, high] = ends.map(([lo, hi]) => ((hi - lo) * VIEW_SIZE) / (2 * FILLED * size));
  const focus = [0, 1, 2].map(k => page.reduce((sum, way, j) => sum + (way[k] * (ends[j][0] + ends[j][1])) / 2, 0));
  return viewOf(eye, [0, 0, 1], focus, 1 / Math.max(high, (wide * clientHeight) / clientWidth));
}

function currentView() {
  const { camera, aspectratio } = element("bodies").layout.scene;
  return { camera, aspectratio };
}

/** Turn a vector about a unit axis (Rodrigues). */
function turned(p, axis, angle) {
  const c = Math.cos(angle), s = Math.sin(angle), along = dot(axis, p), across = cross(axis, p);
  return p.map((x, k) => x * c + across[k] * s + axis[k] * along * (1 - c));
}

const MOVES = {
  left: () => turn("up", -TURN), right: () => turn("up", TURN),
  up: () => turn("side", -TURN), down: () => turn("side", TURN),
  in: () => zoom(ZOOM), out: () => zoom(1 / ZOOM), reset: firstView, near: lookAtContact, normal: lookAlongNormal,
};
const KEYS = {
  ArrowLeft: "left", ArrowRight: "right", ArrowUp: "up", ArrowDown: "down",
  "+": "in", "=": "in", "-": "out", 0: "reset", c: "near", n: "normal",
};

function turn(about, angle) {
  const { camera, aspectratio } = currentView(), up = unit(values(camera.up)), centre = values(camera.center);
  const arm = minus(values(camera.eye), centre);
  const next = turned(arm, about === "up" ? up : unit(cross(up, arm)), angle);
  const steep = Math.acos(dot(up, unit(next)));
  if (about === "side" && (steep < STEEPEST || steep > Math.PI - STEEPEST)) return null;
  return { camera: { ...camera, eye: xyz(next.map((x, k) => x + centre[k])) }, aspectratio };
}

function zoom(factor) {
  const { camera, aspectratio } = currentView(), centre = values(camera.center);
  const moved = centre.map(x => x * factor), eye = minus(values(camera.eye), centre);
  return {
    camera: { ...camera, center: xyz(moved), eye: xyz(eye.map((x, k) => x + moved[k])) },
    aspectratio: xyz(values(aspectratio).map(x => x * factor)),
  };
}

/** The frame shown, or where nothing touches in it a pose in which something does. */
function touchingFrame() {
  const { tracked, corrected, nominal } = currentCase().poses;
  return [currentFrame(), tracked, corrected, nominal].find(each => each?.contacts?.length);
}
const contactsNear = () => touchingFrame()?.contacts ?? [extent().middle];

function lookAtContact() {
  const { camera } = currentView(), contacts = contactsNear();
  return viewOf(minus(values(camera.eye), values(camera.center)), values(camera.up), middle(contacts), NEAR);
}

/** Normal of the first contact: of its face, or across its two edges; else from seed to seed, but across its edge. */
function contactNormal() {
  if (currentCase().normal) return currentCase().normal;
  const frame = currentFrame(), feature = currentCase().feature_shapes[featuresOf(frame)[0]];
  const shapes = (feature?.shapes ?? []).map(shape => ({ kind: shape.kind, points: placed(shape.points, shape.body, frame) }));
  const face = shapes.find(shape => shape.kind === "F"), edges = shapes.filter(shape => shape.kind === "E");
  const [one, two] = edges.map(({ points }) => unit(minus(points[1], points[0])));
  if (face) return cross(minus(face.points[1], face.points[0]), minus(face.points[2], face.points[0]));
  if (two && norm(cross(one, two)) > 1e-6) return cross(one, two);
  const d = minus(...[1, 0].map(body => placed([seedOf(body)], body, frame)[0]));
  return one ? minus(d, one.map(x => x * dot(d, one))) : d;
}

function lookAlongNormal() {
  const normal = contactNormal(), up = Math.abs(unit(normal)[2]) > 0.9 ? [0, 1, 0] : [0, 0, 1];
  return norm(normal) ? viewOf(normal, up, middle(contactsNear()), NEAR) : null;
}

function move(name) {
  const view = element("bodies").layout?.scene && MOVES[name]();
  if (view) Plotly.relayout("bodies", { "scene.camera": view.camera, "scene.aspectratio": view.aspectratio });
}
