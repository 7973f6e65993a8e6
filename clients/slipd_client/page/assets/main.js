// Puts the page together: a source of frames, the state, and the cards that draw it.

import { Connection, RETRY_MS, WRONG_TOKEN, fetchPrivate, showState, token } from "./connection.js";
import { FingerCard } from "./finger.js";
import { UNKNOWN, quantity, setText } from "./format.js";
import { GraspCard } from "./grasp.js";
import { Hand } from "./hand.js";
import { ChangeList, StreamTable } from "./lists.js";
import { Player } from "./player.js";
import { State } from "./state.js";

/** How often the page looks whether something has become stale, ms. */
const LOOK_MS = 100;

const settings = await loadSettings();
const { words } = settings;

const state = new State(!settings.live);
const cards = new Map();
const facts = document.getElementById("facts");
const fingers = document.getElementById("fingers");
const changes = new ChangeList(words);
const streams = new StreamTable(words);
const grasp = new GraspCard(settings.adjust_n ?? 1, (delta_n) => request({ do: "adjust", delta_n }));

const commission = document.getElementById("commission");
commission.hash = token;
commission.hidden = !settings.live || !settings.buttons;
const hand = new Hand((touch) => source.touch(touch), showReply);

let link = "waiting";
let linkText = "";
let permission = settings.buttons ? "" : "this view takes no requests";
let wanted = false;
let frames = 0;

/** What the page must know before its first message; waits for ever with the wrong token. */
async function loadSettings() {
  for (;;) {
    try {
      const answer = await fetchPrivate("settings.json");
      if (answer.ok) return await answer.json();
      if (answer.status === 401) {
        showState("refused", WRONG_TOKEN);
        await new Promise(() => {});
      }
    } catch {
      showState("stale", "STALE: no connection to the view's server; trying again");
    }
    await new Promise((done) => setTimeout(done, RETRY_MS));
  }
}

function showReply(ok, text) {
  const reply = document.getElementById("reply");
  setText(reply, text);
  reply.dataset.ok = String(ok);
  document.getElementById("replies").hidden = !text && !permission;
}

function request(body) {
  showReply(true, "…");
  if (!source.request(body)) showReply(false, "no connection to the view's server; nothing was sent");
}

function wantDraw() {
  if (wanted) return;
  wanted = true;
  requestAnimationFrame(draw);
}

function draw() {
  wanted = false;
  try {
    drawAll();
  } catch (error) {
    // What is drawn is old, and must not look like the present.
    showState("stale", `STALE: what was received cannot be drawn: ${error.message}`);
    for (const card of cards.values()) card.draw(new State(state.recorded));
    throw error;
  }
}

function drawAll() {
  const names = state.fingers();
  for (const name of names) {
    if (!cards.has(name)) {
      const card = new FingerCard(name, words, (finger) => request({ do: "tare", finger }));
      cards.set(name, card);
      fingers.append(card.element);
    }
  }
  for (const [name, card] of cards) {
    if (!names.includes(name) && names.length) {
      card.element.remove();
      cards.delete(name);
      continue;
    }
    card.buttons.hidden = !settings.buttons;
    card.buttons.firstElementChild.disabled = permission !== "";
    card.draw(state);
  }
  hand.draw(cards);
  grasp.buttons.hidden = !settings.buttons || !state.last("gripper");
  for (const button of grasp.buttons.children) button.disabled = permission !== "";
  grasp.draw(state);
  changes.draw(state);
  streams.draw(state);
  drawHeader(names);
}

function drawHeader(names) {
  showState(...condition(names));
  const status = state.last("status");
  const object = status?.object_name ? `object ${status.object_name}` : "";
  const about = status ? `version ${status.version}, up ${quantity(status.uptime_s, 0, "s")}, config ${status.config_id}` : "";
  const unread = state.bad ? `unreadable message: ${state.bad}` : "";
  setText(facts, [settings.source, about, object, unread].filter(Boolean).join(" · "));
}

function condition(names) {
  if (link === "refused") return ["refused", linkText];
  if (link === "closed") return ["stale", `STALE: ${linkText || "no connection to the view's server"}; trying again`];
  if (settings.live && !state.last("status") && !names.length) return ["waiting", "waiting for slipd"];
  if (!settings.live) return ["recording", "recording"];
  const old = state.staleFingers();
  if (!old.length) return ["live", "live"];
  const ages = old.map((finger) => state.age(`slip.${finger}`)).filter((age) => age !== null);
  const since = ages.length ? `no data for ${quantity(Math.min(...ages), 1, "s")}` : "no verdict yet";
  return ["stale", `STALE: ${since} (${old.join(", ")})`];
}

const handlers = {
  onFrame(frame) {
    state.apply(frame);
    frames += 1;
    for (const card of cards.values()) card.note(state);
    wantDraw();
  },
  onPermission(text) {
    permission = text;
    setText(document.getElementById("permission"), text && `requests are not accepted: ${text}`);
    if (text) document.getElementById("replies").hidden = false;
    wantDraw();
  },
  onReply: (reply) => showReply(reply.ok, reply.text),
  onHand(fingers) {
    hand.setFingers(fingers);
    wantDraw();
  },
  onTouched: (reply) => hand.touched(reply),
  onState(word, text) {
    link = word;
    linkText = text;
    if (word !== "open") hand.reset();
    wantDraw();
  },
  onTime(now_ns) {
    state.nowNs = now_ns;
    wantDraw();
  },
  onJump() {
    state.clear();
    for (const card of cards.values()) card.chart.clear();
  },
};

const source = settings.live ? new Connection(handlers) : new Player(handlers);
setInterval(wantDraw, LOOK_MS);

// What tests read: the numbers behind the pictures.
window.slipd = { state, cards, grasp, hand, source, get frames() { return frames; }, UNKNOWN };
