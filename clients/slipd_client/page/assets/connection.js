// The way to the view's server: the token in the page's address, what needs it, and whether the server is reached.

import { setText } from "./format.js";

export const RETRY_MS = 500;

/** The token in the page's address. */
export const token = location.hash.slice(1);

addEventListener("hashchange", () => location.reload()); // another token

/** What people read where the server does not accept the token. */
export const WRONG_TOKEN = "this address is of an earlier start, or not complete: open the one that is printed now";

/** The code with which the server closes the WebSocket then. */
export const WRONG_TOKEN_CODE = 4403;

/** Ask for what the server gives only to those who have the token. */
export const fetchPrivate = (path) => fetch(path, { headers: { Authorization: `Bearer ${token}` } });

/** Open a WebSocket to the server. */
export const openSocket = (path) => new WebSocket(`${location.protocol === "https:" ? "wss" : "ws"}://${location.host}/${path}`);

/** Show whether the server is reached: a word for the style sheet, and a text. */
export function showState(word, text) {
  const element = document.getElementById("connection");
  element.dataset.state = word;
  setText(element, text);
}

/** The WebSocket of the live view: one frame at a time, again whenever it is lost, and only while the page is seen. */
export class Connection {
  /**
   * @param handlers onFrame(frame), onPermission(text), onReply(reply), onState(word, text), onHand(fingers),
   *   onTouched(reply)
   */
  constructor(handlers) {
    this.handlers = handlers;
    this.socket = null;
    this.refused = false;
    document.addEventListener("visibilitychange", () => this.#follow());
    this.#follow();
  }

  #follow() {
    if (document.hidden) {
      this.socket?.close();
      this.socket = null;
    } else if (!this.socket && !this.refused) {
      this.#open();
    }
  }

  #open() {
    const socket = openSocket("live");
    this.socket = socket;
    socket.onopen = () => {
      socket.send(token);
      socket.send("next");
      this.handlers.onState("open", "");
    };
    socket.onmessage = (event) => this.#receive(socket, JSON.parse(event.data));
    socket.onclose = (event) => {
      if (this.socket !== socket) return;
      this.socket = null;
      this.refused = event.code === WRONG_TOKEN_CODE;
      if (this.refused) {
        this.handlers.onState("refused", WRONG_TOKEN);
      } else {
        this.handlers.onState("closed", event.reason);
        setTimeout(() => this.#follow(), RETRY_MS);
      }
    };
  }

  #receive(socket, message) {
    if (message.topics) {
      this.handlers.onFrame(message);
      requestAnimationFrame(() => {
        if (socket.readyState === WebSocket.OPEN) socket.send("next");
      });
    } else if ("permission" in message) {
      this.handlers.onPermission(message.permission);
    } else if (message.reply) {
      this.handlers.onReply(message.reply);
    } else if (message.hand) {
      this.handlers.onHand(message.hand);
    } else if (message.touched) {
      this.handlers.onTouched(message.touched);
    }
  }

  /** Send a request; return whether there was a connection for it. */
  request(body) {
    return this.#send(JSON.stringify(body));
  }

  /** Send a touch of an emulated pad, likewise. */
  touch(body) {
    return this.#send(`touch ${JSON.stringify(body)}`);
  }

  #send(text) {
    if (this.socket?.readyState !== WebSocket.OPEN) return false;
    this.socket.send(text);
    return true;
  }
}
