// What the scripts of all pages share: colours, text, and the data packed into the page.

const element = id => document.getElementById(id);
const all = selector => [...document.querySelectorAll(selector)];
const root = document.documentElement;
const TINY = 1e-4;

/** A number with n digits, as a power of ten where it is tiny. */
function digits(x, n = 6) {
  if (x == null) return "\u2013";
  const rounded = Number(x.toPrecision(n));
  return rounded && Math.abs(rounded) < TINY ? String(rounded.toExponential()) : String(rounded);
}
const pair = values => (values ? `(${values.map(x => digits(x)).join(", ")})` : "\u2013");

/** Colours of the page as it is seen now: light, dark or printed. */
function palette() {
  const style = getComputedStyle(root);
  return new Proxy({}, { get: (_, name) => style.getPropertyValue(`--${name}`).trim() });
}

const FONT = "system-ui, -apple-system, 'Segoe UI', Roboto, 'DejaVu Sans', sans-serif";
const hoverStyle = colours => ({
  bgcolor: colours.raised, bordercolor: colours.muted, font: { family: FONT, size: 13, color: colours.ink },
});
/** Text for plotly, which reads some HTML. */
const plain = text => String(text).replaceAll("&", "&amp;").replaceAll("<", "&lt;").replaceAll(">", "&gt;");

async function unpacked(id) {
  const bytes = Uint8Array.from(atob(element(id).textContent), character => character.charCodeAt(0));
  return new Response(new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"))).text();
}

function loadPlotly(source) {
  const script = document.createElement("script");
  script.textContent = source;
  document.head.append(script);
}
