// Pixels of an OpenEXR file by three.js's EXRLoader, which puts the last row first.
import { readFileSync } from 'node:fs';
import { FloatType } from 'three';
import { EXRLoader } from 'three/examples/jsm/loaders/EXRLoader.js';

const bytes = readFileSync(process.argv[2]);
const loader = new EXRLoader().setDataType(FloatType);
const read = loader.parse(bytes.buffer.slice(bytes.byteOffset, bytes.byteOffset + bytes.byteLength));
console.log(JSON.stringify({ width: read.width, height: read.height, data: Array.from(read.data) }));
