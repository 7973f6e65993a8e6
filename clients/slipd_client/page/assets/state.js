// The newest message of each topic, and how old it is.

/** Age beyond which a message no longer describes the present, s, for topics that come often. */
const STALE_S = 0.7;

/** Topics that the daemon sends seldom are stale after so many of their periods, but never later than this, s. */
const PERIODS = 2.5;
const SLOWEST_PERIOD_S = 1.2;

const CHANGES = 200;

export class State {
  /** @param recorded whether time is that of a recording, and not of a clock that runs */
  constructor(recorded) {
    this.recorded = recorded;
    this.clear();
  }

  clear() {
    this.topics = new Map();
    this.changes = [];
    this.seen = new Set();
    this.boot = "";
    this.nowNs = null;
    this.bad = "";
    this.restarts = 0;
  }

  /** Add a frame that has just arrived; its messages may have reached the server earlier, by their ages. */
  apply(frame) {
    const nowMs = performance.now();
    this.nowNs = frame.now_ns ?? null;
    this.bad = frame.bad ?? "";
    for (const [topic, body] of Object.entries(frame.topics)) {
      if (body.boot !== this.boot) this.#begin(body.boot);
      const before = this.topics.get(topic);
      if (before?.body.seq === body.seq) continue; // sent again: no younger than it was
      const period = before ? Math.min(Math.max(body.t_ns - before.body.t_ns, 0) / 1e9, SLOWEST_PERIOD_S) : 0;
      const period_s = before ? 0.8 * before.period_s + 0.2 * period : topic === "status" ? 1 : 0;
      this.topics.set(topic, { body, arrivedMs: nowMs - 1000 * (frame.ages?.[topic] ?? 0), period_s });
    }
    for (const change of frame.changes) this.#change(change);
  }

  #begin(boot) {
    if (this.boot) this.restarts += 1;
    this.boot = boot;
    this.topics.clear();
  }

  #change(change) {
    const key = `${change.boot} ${change.seq}`;
    if (this.seen.has(key)) return; // sent again to a browser that came back
    this.seen.add(key);
    this.changes.unshift(change);
    for (const old of this.changes.splice(CHANGES)) this.seen.delete(`${old.boot} ${old.seq}`);
  }

  /**
   * Age of the newest message of a topic, s; null before the first.
   *
   * The daemon sends a new subscriber the last message of each topic: one that is older than the newest `status` is old,
   * although it has just arrived.
   */
  age(topic) {
    const newest = this.topics.get(topic);
    if (!newest) return null;
    const clock_ns = this.recorded ? this.nowNs : this.last("status")?.t_ns;
    const behind_s = clock_ns ? (clock_ns - newest.body.t_ns) / 1e9 : 0;
    const sinceArrival_s = this.recorded ? 0 : (performance.now() - newest.arrivedMs) / 1000;
    return Math.max(behind_s, sinceArrival_s, 0);
  }

  stale(topic) {
    const age = this.age(topic);
    return age === null || age > Math.max(STALE_S, PERIODS * this.topics.get(topic).period_s);
  }

  /** The newest message of a topic; null before the first, or if it no longer describes the present. */
  fresh(topic) {
    return this.stale(topic) ? null : this.topics.get(topic).body;
  }

  /** The newest message of a topic, however old. */
  last(topic) {
    return this.topics.get(topic)?.body ?? null;
  }

  /** Names of the fingers, in the order of the config. */
  fingers() {
    const listed = Object.keys(this.last("status")?.fingers ?? {});
    const seen = [...this.topics.keys()].filter((topic) => topic.startsWith("slip.")).map((topic) => topic.slice(5));
    return [...new Set([...listed, ...seen.sort()])];
  }

  /** Fingers whose verdict is missing or out of date. */
  staleFingers() {
    return this.fingers().filter((finger) => this.stale(`slip.${finger}`));
  }
}
