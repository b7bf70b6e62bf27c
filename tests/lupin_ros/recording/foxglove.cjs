// A recording as Foxglove and Lichtblick read it, by their own packages: `node foxglove.cjs MODULES FILE.mcap`
// prints, as JSON, the profile, how many messages of each topic were decoded by either, and some of what they say.
const { createRequire } = require("node:module");
const { readFile } = require("node:fs/promises");
const from = createRequire(`${process.argv[2]}/`);
const { McapIndexedReader } = from("@mcap/core");
const { loadDecompressHandlers } = from("@mcap/support");
const makers = ["foxglove", "lichtblick"].map((of) => [
  from(`@${of}/rosmsg`).parse, from(`@${of}/rosmsg2-serialization`).MessageReader]);

(async () => {
  const bytes = new Uint8Array(await readFile(process.argv[3]));
  const readable = {
    size: async () => BigInt(bytes.length),
    read: async (from, length) => bytes.subarray(Number(from), Number(from + length)),
  };
  const reader = await McapIndexedReader.Initialize({ readable, decompressHandlers: await loadDecompressHandlers() });
  const decoders = new Map();
  const counts = {};
  const last = {};
  for await (const message of reader.readMessages()) {
    const channel = reader.channelsById.get(message.channelId);
    const schema = reader.schemasById.get(channel.schemaId);
    if (!decoders.has(schema.id)) {
      const text = new TextDecoder().decode(schema.data);
      decoders.set(schema.id, makers.map(([parse, Reader]) => new Reader(parse(text, { ros2: true }))));
    }
    const [one, other] = decoders.get(schema.id).map((decoder) => decoder.readMessage(message.data));
    const told = [one, other].map((value) => JSON.stringify(value, (_, part) =>
      typeof part === "bigint" ? Number(part) : ArrayBuffer.isView(part) ? Array.from(part) : part));
    told[1] = told[1].replaceAll('"nsec"', '"nanosec"'); // their one difference
    if (told[0] !== told[1]) throw new Error(`${channel.topic}: ${told[0]} is ${told[1]}`);
    counts[channel.topic] = (counts[channel.topic] ?? 0) + 1;
    last[channel.topic] = JSON.parse(told[0]);
  }
  console.log(JSON.stringify({ profile: reader.header.profile, counts, last }));
})();
