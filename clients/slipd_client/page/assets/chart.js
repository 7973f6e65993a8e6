// R and μ of one finger over the last seconds.

import { colour } from "./canvas.js";
import { isNumber } from "./format.js";

export const SECONDS = 20;
const HEIGHT = 150;

/** Verdicts that are further apart are not joined by a line, s. */
const GAP_S = 0.7;

/** Shortest time between two drawings, ms: a chart shows the past. */
const REDRAW_MS = 100;

const SERIES = [
  ["R", "friction_ratio", "--centroid", {}],
  ["μ", "mu", "--ink", { dash: [6, 3] }],
  ["μ low", "mu_low", "--line", {}],
  ["μ high", "mu_high", "--line", {}],
  ["required", "required_friction", "--pole", { dash: [2, 3] }],
];

export class Chart {
  constructor(element) {
    this.element = element;
    this.rows = [];
    this.drawnMs = 0;
    this.theme = matchMedia("(prefers-color-scheme: dark)");
    this.theme.addEventListener("change", () => this.#make());
    new ResizeObserver(() => this.#resize()).observe(element);
    this.#make();
  }

  clear() {
    this.rows = [];
  }

  /** Add a verdict; a time without any leaves a gap. */
  add(t_s, slip) {
    const last = this.rows.at(-1);
    if (last && t_s < last[0]) this.rows = []; // another run, or a jump back in a recording
    if (last && t_s === last[0]) return;
    if (last && t_s - last[0] > GAP_S) this.rows.push([(last[0] + t_s) / 2, ...SERIES.map(() => null)]);
    this.rows.push([t_s, ...SERIES.map(([, field]) => (isNumber(slip[field]) ? slip[field] : null))]);
    const begin = this.rows.findIndex((row) => row[0] >= t_s - SECONDS - 1);
    if (begin > 60) this.rows.splice(0, begin);
  }

  draw(now_s, at_once = false) {
    const nowMs = performance.now();
    if (!at_once && nowMs - this.drawnMs < REDRAW_MS) return;
    this.drawnMs = nowMs;
    const columns = [this.rows.map((row) => row[0] - now_s)];
    SERIES.forEach((_, index) => columns.push(this.rows.map((row) => row[index + 1])));
    this.plot.setData(columns);
  }

  #make() {
    this.plot?.destroy();
    const axis = { stroke: colour("--faint"), grid: { stroke: colour("--line"), width: 0.5 }, ticks: { show: false } };
    const series = SERIES.map(([name, , ink, more]) => ({
      label: name, stroke: colour(ink), width: 2, points: { show: false }, ...more,
    }));
    const options = {
      width: Math.max(this.element.clientWidth, 200),
      height: HEIGHT,
      cursor: { show: false },
      legend: { show: true, live: false },
      scales: { x: { time: false, range: [-SECONDS, 0] }, y: { range: (_, low, high) => [0, Math.max(high ?? 0, 0.1) * 1.1] } },
      axes: [
        { ...axis, size: 26, values: (_, ticks) => ticks.map((each) => `${each} s`.replace("-", "−")) },
        { ...axis, size: 42 },
      ],
      series: [{}, ...series],
      bands: [{ series: [4, 3], fill: colour("--band") }],
    };
    this.plot = new uPlot(options, [[], ...SERIES.map(() => [])], this.element);
  }

  #resize() {
    const width = this.element.clientWidth;
    if (width > 0 && width !== this.plot.width) this.plot.setSize({ width, height: HEIGHT });
  }
}
