// Header, descriptor, keys and levels of a KTX 2.0 file by ktx-parse; levels in hexadecimal.
import { readFileSync } from 'node:fs';
import { read } from 'ktx-parse';

const found = read(new Uint8Array(readFileSync(process.argv[2])));
const levels = found.levels.map((level) => Buffer.from(level.levelData).toString('hex'));
const text = (value) => (typeof value === 'string' ? value : new TextDecoder().decode(value).replace(/\0$/, ''));
const keyValue = Object.fromEntries(Object.entries(found.keyValue).map(([key, value]) => [key, text(value)]));
console.log(JSON.stringify({ ...found, keyValue, globalData: null, levels }));
