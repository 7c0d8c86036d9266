// Reads an MCAP file with npm's @mcap/core and prints one JSON line a record: nothing of it is shared with padbench.
// node read_mcap.mjs FILE indexed|stream   (indexed: by the file's index, refuses a torn file; stream: front to back)
import { readFileSync } from "node:fs";
import { createRequire } from "node:module";

const require = createRequire(import.meta.url);
const { McapIndexedReader, McapStreamReader } = require("@mcap/core");
const zstd = require("@foxglove/wasm-zstd");

const [file, how] = process.argv.slice(2);
await zstd.isLoaded;
const decompressHandlers = { zstd: (data, size) => zstd.decompress(data, Number(size)) };
const bytes = readFileSync(file);
const lines = [];

function text(data) {
  return new TextDecoder("utf-8", { fatal: true }).decode(data);
}

function say(record, channel) {
  if (record.type === "Message") {
    lines.push({
      type: "message", topic: channel.topic, sequence: record.sequence,
      log: String(record.logTime), publish: String(record.publishTime), data: text(record.data),
    });
  } else if (record.type === "Metadata") {
    lines.push({ type: "metadata", name: record.name, fields: Object.fromEntries(record.metadata) });
  } else if (record.type === "Attachment") {
    lines.push({ type: "attachment", name: record.name, media: record.mediaType, data: text(record.data) });
  }
}

function describe(channel, schema) {
  lines.push({
    type: "channel", topic: channel.topic, encoding: channel.messageEncoding,
    schema: schema.name, schemaEncoding: schema.encoding, schemaData: JSON.parse(text(schema.data)),
  });
}

if (how === "indexed") {
  const readable = {
    size: async () => BigInt(bytes.length),
    read: async (offset, length) => new Uint8Array(bytes.subarray(Number(offset), Number(offset + length))),
  };
  const reader = await McapIndexedReader.Initialize({ readable, decompressHandlers });
  for (const channel of reader.channelsById.values()) describe(channel, reader.schemasById.get(channel.schemaId));
  for await (const message of reader.readMessages()) say(message, reader.channelsById.get(message.channelId));
  for await (const metadata of reader.readMetadata()) say(metadata);
  for await (const attachment of reader.readAttachments()) say(attachment);
  lines.push({ type: "end", messages: String(reader.statistics.messageCount) });
} else {
  const reader = new McapStreamReader({ decompressHandlers, validateCrcs: true });
  const schemas = new Map();
  const channels = new Map();
  reader.append(bytes);
  for (let record; (record = reader.nextRecord()); ) {
    if (record.type === "Schema") schemas.set(record.id, record);
    if (record.type === "Channel" && !channels.has(record.id)) {
      channels.set(record.id, record);
      describe(record, schemas.get(record.schemaId));
    }
    say(record, channels.get(record.channelId));
  }
  lines.push({ type: "end", done: reader.done() });
}
process.stdout.write(lines.map((line) => JSON.stringify(line)).join("\n") + "\n");
