// Reads MCAP recordings as Foxglove does, by its own libraries of npm: by their index, unpacked, in order of time; and what a schema of
// Foxglove names is held against that schema.
//
// Usage: node tests/mcap.mjs MODULES FILE TOPIC=MESSAGES...
// MODULES: a folder with node_modules. MESSAGES: how many there have to be, or `some`. Exit code 1 if something is wrong.
import assert from "node:assert";
import { readFileSync } from "node:fs";
import { createRequire } from "node:module";
import { resolve } from "node:path";

const [modules, file, ...expected] = process.argv.slice(2);
const load = createRequire(resolve(modules, "node_modules/"));
const { McapIndexedReader } = load("@mcap/core");
const { loadDecompressHandlers } = load("@mcap/support");
const foxglove = load("@foxglove/schemas/jsonschema");
const Ajv = load("ajv").default;

const bytes = readFileSync(file);
const readable = {
  size: async () => BigInt(bytes.length),
  read: async (at, size) => new Uint8Array(bytes.buffer, bytes.byteOffset + Number(at), Number(size)),
};
const reader = await McapIndexedReader.Initialize({ readable, decompressHandlers: await loadDecompressHandlers() });
const checks = new Map();
for (const [id, schema] of reader.schemasById) {
  const ajv = new Ajv({ strict: false });
  if (schema.encoding !== "jsonschema") continue;
  const schemas = [JSON.parse(new TextDecoder().decode(schema.data))];
  if (schema.name.startsWith("foxglove.")) {
    assert(schema.name.slice(9) in foxglove, `${schema.name} is no schema of Foxglove`);
    schemas.push(foxglove[schema.name.slice(9)]);
  }
  checks.set(id, schemas.map((each) => ajv.compile(each)));
}
const counts = {};
let before = 0n;
for await (const message of reader.readMessages()) {
  const channel = reader.channelsById.get(message.channelId);
  counts[channel.topic] = (counts[channel.topic] ?? 0) + 1;
  assert(message.logTime >= before, `${channel.topic} is out of order`);
  before = message.logTime;
  if (!checks.has(channel.schemaId)) continue;
  const value = JSON.parse(new TextDecoder().decode(message.data));
  for (const check of checks.get(channel.schemaId)) {
    assert(check(value), `${channel.topic} at ${message.logTime}: ${JSON.stringify(check.errors)}`);
  }
}
const compression = new Set(reader.chunkIndexes.map((chunk) => chunk.compression || "none"));
console.log(file, [...compression].join(" "), JSON.stringify(counts));
for (const each of expected) {
  const [topic, messages] = each.split("=");
  if (topic === "compression") assert(compression.has(messages), `it is not compressed with ${messages}`);
  else if (messages === "some") assert(counts[topic] > 0, `there is nothing on ${topic}`);
  else assert.equal(String(counts[topic]), messages, topic);
}
