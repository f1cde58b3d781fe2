// What docs/try makes of files, without a browser: node run_try.js try.js FILE … prints a line of JSON for each.
"use strict";
const fs = require("fs"), vm = require("vm"), zlib = require("zlib");

const element = () => ({ replaceChildren() {}, value: "", hidden: false });
const page = vm.createContext({ document: { getElementById: element }, Option: class {}, console });
const [, , script, ...files] = process.argv;
vm.runInContext(fs.readFileSync(script, "utf8"), page);
for (const file of files) {
  const bytes = fs.readFileSync(file);
  page.text = (file.endsWith(".gz") ? zlib.gunzipSync(bytes) : bytes).toString();
  console.log(vm.runInContext(`(() => { try {
    const log = parse(text), chosen = { unit: "m", T_s: NaN };
    for (const [role, known] of Object.entries(NAMES))
      chosen[role] = known.split(" ").map((name) => log.names.findIndex((one) => plain(one) === name)).find((j) => j >= 0) ?? "";
    if (chosen.x_d === "" || chosen.x === "" || chosen.t === "") return JSON.stringify({ refused: "choose" });
    const { x_d, x, T_s } = samples(log, chosen);
    return JSON.stringify({ n: x.length, T_s, x_d: [...x_d.slice(0, 400)], x: [...x.slice(0, 400)] });
  } catch (error) {
    if (!(error instanceof LogError)) throw error;
    return JSON.stringify({ refused: error.message });
  } })()`, page));
}
