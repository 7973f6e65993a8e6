// Closes the gripper with FORCE_N on each pad, and prints every reply, a JSON map a line.
//     node requester.mjs ENDPOINT FORCE_N
import { VERSION, decode, encode, print, zmq } from "./wire.mjs";

const DEADLINE_NS = 250_000_000n;
const LEASE_MS = 200;
const PATIENCE_MS = 30_000;

const [endpoint, force] = process.argv.slice(2);
// immediate: without it ZeroMQ keeps a request for a daemon that starts later
const socket = new zmq.Dealer({ linger: 0, immediate: true, sendTimeout: 5000, receiveTimeout: 5000 });
socket.connect(endpoint);

const name = `node-${process.pid}-${Date.now()}`;
let number = 0;
let boot;
let ahead = 0n; // of the daemon's clock

async function ask(op, fields = {}) {
  const id = `${name}-${++number}`;
  const sent = process.hrtime.bigint();
  const run = boot === undefined ? {} : { boot, deadline_ns: sent + ahead + DEADLINE_NS };
  await socket.send(encode({ v: VERSION, id, op, ...run, ...fields }));
  for (;;) {
    const [bytes] = await socket.receive();
    const reply = decode(bytes);
    if (reply.id !== id && reply.id !== null) continue; // late; null answers bytes that are no acceptable map
    if (op === "hello") {
      boot = reply.result.boot;
      ahead = BigInt(reply.t_ns) - (sent + process.hrtime.bigint()) / 2n;
    }
    return reply;
  }
}

async function show(op, fields) {
  const reply = await ask(op, fields);
  print({ op, ...reply });
  return reply;
}

await show("hello");
await show("grip.set", { force_n: Number(force) }); // refused: no lease yet
await show("lease.acquire", { ttl_ms: LEASE_MS });
await show("grip.set", { force_n: NaN }); // refused: no number
await show("gripper.activate", { drop: true }); // whether a finger touches anything is not known here
const until = Date.now() + PATIENCE_MS;
let closed;
do {
  await new Promise((resolve) => setTimeout(resolve, LEASE_MS / 4));
  await ask("lease.renew");
  closed = await ask("gripper.close", { force_n: Number(force) });
} while (["not_active", "activating"].includes(closed.error?.code) && Date.now() < until);
print({ op: "gripper.close", ...closed });
await show("lease.release");
socket.close();
