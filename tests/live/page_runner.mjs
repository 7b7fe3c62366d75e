// Answer jobs of an exported page without a browser: node page_runner.mjs machine.html.
// A job is a line of JSON; so is its answer, with displacements as base64.
import {readFileSync} from 'node:fs';
import {createInterface} from 'node:readline';

const text = readFileSync(process.argv[2], 'utf8');
const data = JSON.parse(/id="machine-data">(.*?)<\/script>/s.exec(text)[1]);
const {answer, begin} = new Function('postMessage', `let onmessage; ${data.worker}; return modules.worker;`)();
begin({module: await WebAssembly.compile(Buffer.from(data.wasm, 'base64')), model: data.model});
for await (const line of createInterface({input: process.stdin})) {
  const job = {profile: data.profile, ...JSON.parse(line)};
  const {status, gap, diverged, sizes = [], bands} = answer({...job, kind: 'numbers'});
  const {moved = new Float64Array(0)} = status < 0 ? {} : answer({...job, kind: 'samples'});
  console.log(JSON.stringify({
    status, gap, diverged, sizes: Array.from(sizes), bands: bands && Array.from(bands),
    moved: Buffer.from(moved.buffer).toString('base64'),
  }));
}
