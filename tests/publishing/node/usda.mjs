// A text stage of USD by three.js's parser.
import { readFileSync } from 'node:fs';
import { USDAParser } from 'three/examples/jsm/loaders/usd/USDAParser.js';

console.log(JSON.stringify(new USDAParser().parseText(readFileSync(process.argv[2], 'utf8'))));
