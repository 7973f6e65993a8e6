// A canvas in CSS pixels, sharp on every display, with the colours of the page.

/** Colours of the style sheet, read again when the theme changes. */
const colours = new Map();
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => colours.clear());

/** The value of a custom property of the page, e.g. "--ink". */
export function colour(name) {
  if (!colours.has(name)) {
    colours.set(name, getComputedStyle(document.documentElement).getPropertyValue(name).trim());
  }
  return colours.get(name);
}

/** Size a canvas to its box and clear it; return its context and its size in CSS pixels. */
export function begin(canvas) {
  const ratio = window.devicePixelRatio || 1;
  const { clientWidth: width, clientHeight: height } = canvas;
  const [across, down] = [Math.round(width * ratio), Math.round(height * ratio)];
  if (canvas.width !== across || canvas.height !== down) {
    canvas.width = across;
    canvas.height = down;
  }
  const context = canvas.getContext("2d");
  context.setTransform(ratio, 0, 0, ratio, 0, 0);
  context.clearRect(0, 0, width, height);
  context.font = "13px system-ui, sans-serif";
  context.textBaseline = "middle";
  return { context, width, height };
}

export function line(context, from, to) {
  context.beginPath();
  context.moveTo(...from);
  context.lineTo(...to);
  context.stroke();
}

export function circle(context, x, y, radius) {
  context.beginPath();
  context.arc(x, y, Math.max(radius, 0), 0, 2 * Math.PI);
}

/** Fill a box with slanted lines, as for a value that is not known. */
export function hatch(context, x, y, width, height, ink) {
  context.save();
  context.beginPath();
  context.rect(x, y, width, height);
  context.clip();
  context.strokeStyle = ink;
  context.lineWidth = 4;
  for (let begin = x - height; begin < x + width; begin += 14) line(context, [begin, y + height], [begin + height, y]);
  context.restore();
}

/** A line with a head at `to`. */
export function arrow(context, from, to, head = 8) {
  const angle = Math.atan2(to[1] - from[1], to[0] - from[0]);
  line(context, from, to);
  context.beginPath();
  context.moveTo(...to);
  for (const side of [-0.45, 0.45]) {
    context.lineTo(to[0] - head * Math.cos(angle + side), to[1] - head * Math.sin(angle + side));
  }
  context.closePath();
  context.fill();
}

/** Text with a rim in the colour of the background, so that it can be read on anything. */
export function label(context, text, x, y, ink) {
  context.lineWidth = 4;
  context.lineJoin = "round";
  context.strokeStyle = colour("--card");
  context.strokeText(text, x, y);
  context.fillStyle = ink;
  context.fillText(text, x, y);
}
