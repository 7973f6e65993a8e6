// The WebSocket to the view's server: one frame at a time, again whenever it is lost, and only while the page is seen.

export const RETRY_MS = 500;

/** What people read where the server does not accept the token. */
export const WRONG_TOKEN = "this address is of an earlier start, or not complete: open the one that is printed now";

/** The code with which the server closes the WebSocket then. */
const WRONG_TOKEN_CODE = 4403;

export class Connection {
  /**
   * @param token the token in the page's address
   * @param handlers onFrame(frame), onPermission(text), onReply(reply), onState(word, text), onHand(fingers),
   *   onTouched(reply)
   */
  constructor(token, handlers) {
    this.token = token;
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
    const socket = new WebSocket(`${location.protocol === "https:" ? "wss" : "ws"}://${location.host}/live`);
    this.socket = socket;
    socket.onopen = () => {
      socket.send(this.token);
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
