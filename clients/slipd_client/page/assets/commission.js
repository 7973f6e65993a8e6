// The page /commission: what the guide of `slipd commission` says, and what the person chooses.

import { WRONG_TOKEN, WRONG_TOKEN_CODE, openSocket, showState, token } from "./connection.js";
import { length, parts, quantity, setText } from "./format.js";

const LOST = "the connection to the view's server was lost; nothing more is written";
const NO_GUIDE = "no connection to the guide: the view's server is gone, or it was started without buttons";

const byId = (id) => document.getElementById(id);
let socket = null;
let ended = false;
let config = "";

byId("back").hash = token;
byId("typed").addEventListener("submit", (event) => {
  event.preventDefault();
  const text = byId("typed-text").value.trim();
  if (text) choose(text);
});
begin();

function begin() {
  ended = false;
  byId("log").replaceChildren();
  byId("change").hidden = true;
  showPrompt("The guide starts.", "", []);
  socket = openSocket("commission-guide");
  let opened = false;
  socket.onopen = () => {
    opened = true;
    socket.send(token);
  };
  socket.onmessage = (event) => receive(JSON.parse(event.data));
  socket.onclose = (event) => {
    if (event.code === WRONG_TOKEN_CODE) showState("refused", WRONG_TOKEN);
    else if (!ended) end(opened ? LOST : NO_GUIDE);
  };
}

/** One message of the guide; each has one key. */
function receive(message) {
  if (message.config) {
    config = message.config;
    setText(byId("facts"), config);
    showState("live", "the guide runs");
  } else if (message.say !== undefined) {
    say(message.say);
  } else if (message.prompt) {
    const { text, step, choices, free } = message.prompt;
    showPrompt(text, step, choices, free);
  } else if (message.change) {
    setText(byId("toml"), message.change);
    byId("change").hidden = false;
  } else if (message.live) {
    showReadings(message.live);
  } else if (message.unavailable) {
    end(message.unavailable);
  } else if (message.ended) {
    end(message.ended.error, message.ended.code === 0 ? "Everything followed." : "Not everything followed: see what was found.");
  }
}

function say(text) {
  const line = document.createElement("li");
  line.textContent = text.trim();
  if (!line.textContent) return;
  byId("log").append(line);
  byId("log").scrollTop = byId("log").scrollHeight;
  setText(byId("newest"), line.textContent);
}

/** Show what to do, a button for each choice, and where something else may be typed, a field for it. */
function showPrompt(text, step, choices, free = "") {
  setText(byId("prompt"), text);
  setText(byId("newest"), "");
  byId("prompt").dataset.kind = "prompt";
  byId("prompt").dataset.step = step;
  for (const touch of document.querySelectorAll(".touch")) touch.classList.toggle("asked", touch.dataset.step === step);
  const buttons = choices.map((word) => button(word[0].toUpperCase() + word.slice(1), word, () => choose(word)));
  if (step) buttons.push(button("Begin again", "restart", restart));
  byId("choices").replaceChildren(...buttons);
  byId("typed").hidden = !free;
  setText(byId("typed-label"), free ? `or type ${free}` : "");
  byId("typed-text").value = "";
}

function button(text, word, act) {
  const made = document.createElement("button");
  made.type = "button";
  made.textContent = text;
  made.dataset.word = word;
  made.addEventListener("click", act);
  return made;
}

function choose(word) {
  if (word === "write" && !confirm(`Write the lines into ${config}? The config before is kept beside it.`)) return;
  socket.send(JSON.stringify({ choose: word }));
}

function restart() {
  ended = true; // on purpose
  socket.onclose = begin;
  socket.close();
}

/** Show how it ended; an error says why. */
function end(error, text = "") {
  ended = true;
  showState(error ? "refused" : "recording", error ? "not finished" : "finished");
  showPrompt(error || text, "", []);
  if (error) byId("prompt").dataset.kind = "error";
  byId("choices").replaceChildren(button("Begin again", "restart", begin));
}

function showReadings(live) {
  byId("reading-rows").replaceChildren(
    ...Object.entries(live).map(([finger, [force_n, torque_nm]]) => {
      const row = document.createElement("tr");
      row.dataset.finger = finger;
      for (const text of [finger, quantity(length(force_n), 2, "N"), parts(force_n, 2, ""), parts(torque_nm, 3, "")]) {
        row.append(Object.assign(document.createElement("td"), { textContent: text }));
      }
      return row;
    }),
  );
}
