// Reads messages as Foxglove does: JSON of [definition, hex] in, of values out. Numbers that JSON has no word for are text.
const { parse } = require("@foxglove/rosmsg");
const { MessageReader } = require("@foxglove/rosmsg2-serialization");

const plain = (value) => {
  if (typeof value === "bigint") return Number(value);
  if (typeof value === "number") return Number.isFinite(value) ? value : String(value);
  if (ArrayBuffer.isView(value) || Array.isArray(value)) return Array.from(value, plain);
  if (value !== null && typeof value === "object")
    return Object.fromEntries(Object.entries(value).map(([key, each]) => [key, plain(each)]));
  return value;
};

let text = "";
process.stdin.on("data", (part) => (text += part));
process.stdin.on("end", () => {
  const read = ([definition, hex]) =>
    plain(new MessageReader(parse(definition, { ros2: true })).readMessage(Buffer.from(hex, "hex")));
  process.stdout.write(JSON.stringify(JSON.parse(text).map(read)));
});
