// The wire of slipd: msgpack maps. Times are 64-bit nanoseconds, more than a JavaScript number holds after 104 days.
import { createRequire } from "node:module";

const require = createRequire(import.meta.url); // looks into NODE_PATH too, unlike import
const { Decoder, Encoder } = require("@msgpack/msgpack");
const decoder = new Decoder({ useBigInt64: true });
const encoder = new Encoder({ useBigInt64: true });

export const VERSION = 1;
export const zmq = require("zeromq");
export const encode = (map) => encoder.encode(map);
export const decode = (bytes) => decoder.decode(bytes);

export const print = (map) =>
  console.log(JSON.stringify(map, (_, value) => (typeof value === "bigint" ? value.toString() : value)));
