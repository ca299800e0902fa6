// Reads the pictures of a recording by packages of Foxglove. Usage: node recording.cjs FILE
// Prints one line of JSON for each: topic, stamp and time of its log [ns], format, SHA-256 of its data.

const { McapIndexedReader } = require("@mcap/core");
const { loadDecompressHandlers } = require("@mcap/support");
const { parse } = require("@foxglove/rosmsg");
const { MessageReader } = require("@foxglove/rosmsg2-serialization");
const { createHash } = require("crypto");
const { readFileSync } = require("fs");

async function main(bytes) {
  const readable = {
    size: async () => BigInt(bytes.length),
    read: async (at, length) => new Uint8Array(bytes.subarray(Number(at), Number(at + length))),
  };
  const reader = await McapIndexedReader.Initialize({ readable, decompressHandlers: await loadDecompressHandlers() });
  const channels = [...reader.channelsById.values()].filter(
    ({ schemaId }) => reader.schemasById.get(schemaId)?.name === "foxglove_msgs/msg/CompressedImage",
  );
  const definition = (id) => new TextDecoder().decode(reader.schemasById.get(id).data);
  const readers = new Map(channels.map(({ id, schemaId }) => [id, new MessageReader(parse(definition(schemaId), { ros2: true }))]));
  for await (const { channelId, data, logTime } of reader.readMessages({ topics: channels.map(({ topic }) => topic) })) {
    const { timestamp, format, data: picture } = readers.get(channelId).readMessage(data);
    const stamp = BigInt(timestamp.sec) * 1000000000n + BigInt(timestamp.nanosec ?? timestamp.nsec);
    const digest = createHash("sha256").update(picture).digest("hex");
    console.log(JSON.stringify({ topic: reader.channelsById.get(channelId).topic, stamp: String(stamp), logged: String(logTime), format, digest }));
  }
}

main(readFileSync(process.argv[2]));
