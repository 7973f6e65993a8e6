// Prints COUNT messages of the topics that begin with TOPIC, a JSON map a line, and what was missed before each.
//     node subscriber.mjs ENDPOINT TOPIC COUNT
import { VERSION, decode, print, zmq } from "./wire.mjs";

const [endpoint, beginning, count] = process.argv.slice(2);
const socket = new zmq.Subscriber({ linger: 0, receiveTimeout: 30000 });
socket.connect(endpoint);
socket.subscribe(beginning);

let boot;
let left = Number(count);
const newest = new Map();
for await (const [name, bytes] of socket) {
  const topic = name.toString();
  const message = decode(bytes);
  if (message.v !== VERSION) throw new Error(`version ${message.v} is not read here`);
  const restarted = boot !== undefined && boot !== message.boot;
  if (restarted) newest.clear();
  boot = message.boot;
  const seq = Number(message.seq);
  const last = newest.get(topic) ?? seq - 1;
  if (seq <= last) continue; // sent again to whoever joins
  newest.set(topic, seq);
  print({ ...message, topic, missed: seq - last - 1, restarted });
  if (--left === 0) break;
}
socket.close();
