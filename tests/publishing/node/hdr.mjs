// Pixels of a Radiance file by three.js's HDRLoader, the first row first.
import { readFileSync } from 'node:fs';
import { FloatType } from 'three';
import { HDRLoader } from 'three/examples/jsm/loaders/HDRLoader.js';

const bytes = readFileSync(process.argv[2]);
const loader = new HDRLoader().setDataType(FloatType);
const read = loader.parse(bytes.buffer.slice(bytes.byteOffset, bytes.byteOffset + bytes.byteLength));
console.log(JSON.stringify({ width: read.width, height: read.height, data: Array.from(read.data), header: read.header }));
