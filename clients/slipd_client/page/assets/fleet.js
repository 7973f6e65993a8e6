// The page of `slipctl fleet --page`: every robot in a row, asked for twice a second. It only shows.

import { WRONG_TOKEN, fetchPrivate, showState } from "./connection.js";
import { isNumber, quantity, setText, UNKNOWN } from "./format.js";
import { known, word } from "./levels.js";

const PERIOD_MS = 500;

const STALE_MS = 2000;

const byId = (id) => document.getElementById(id);
const rows = new Map();
let answeredMs = 0;

window.slipd = { rows };
follow();

async function follow() {
  if (!document.hidden && !(await ask())) return;
  setTimeout(follow, PERIOD_MS);
}

/** Ask for the fleet, and show it; return whether to ask again. */
async function ask() {
  try {
    const answer = await fetchPrivate("data/fleet.json");
    if (answer.status === 401) {
      showState("refused", WRONG_TOKEN);
      return false;
    }
    show(await answer.json());
    answeredMs = performance.now();
    showState("live", "live");
  } catch {
    if (performance.now() - answeredMs > STALE_MS) {
      showState("waiting", "stale: the fleet's server does not answer");
      for (const robot of rows.keys()) showLevel(rows.get(robot).cells[2], "unknown");
    }
  }
  return true;
}

function show(fleet) {
  const live = fleet.robots.filter((robot) => robot.state === "live").length;
  const unread = fleet.unread ? `, ${fleet.unread} messages not read` : "";
  setText(byId("facts"), `${fleet.fleet}: ${live} of ${fleet.robots.length} robots are live${unread}`);
  byId("no-robots").hidden = fleet.robots.length > 0;
  const listed = new Set(fleet.robots.map((robot) => robot.robot));
  for (const [name, row] of rows) {
    if (listed.has(name)) continue;
    row.remove();
    rows.delete(name);
  }
  const body = byId("robot-rows");
  fleet.robots.forEach((robot, place) => {
    const row = rows.get(robot.robot) ?? newRow(robot.robot);
    fill(row, robot);
    if (body.rows[place] !== row) body.insertBefore(row, body.rows[place] ?? null);
  });
}

function newRow(name) {
  const row = document.createElement("tr");
  for (let cell = 0; cell < 6; cell += 1) row.insertCell();
  const level = document.createElement("span");
  level.className = "level";
  row.cells[2].append(level);
  row.dataset.robot = name;
  rows.set(name, row);
  return row;
}

function fill(row, robot) {
  row.dataset.state = robot.state;
  row.dataset.health = robot.health ?? UNKNOWN;
  const [name, state, level, health, age, remarks] = row.cells;
  setText(name, robot.robot);
  setText(state, robot.state);
  showLevel(level, robot.level);
  setText(health, robot.health ?? UNKNOWN);
  setText(age, isNumber(robot.age_s) ? quantity(robot.age_s, 1, "s") : UNKNOWN);
  setText(remarks, robot.remarks);
}

function showLevel(cell, level) {
  cell.firstChild.dataset.level = known(level);
  setText(cell.firstChild, word(level));
}
