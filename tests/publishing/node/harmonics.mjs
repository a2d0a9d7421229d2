// Radiance and irradiance of nine coefficients in directions, by three.js's SphericalHarmonics3.
import { readFileSync } from 'node:fs';
import { SphericalHarmonics3, Vector3 } from 'three';

const { coefficients, directions } = JSON.parse(readFileSync(process.argv[2]));
const harmonics = new SphericalHarmonics3().set(coefficients.map((one) => new Vector3(...one)));
const values = directions.map((one) => {
    const n = new Vector3(...one);
    return [harmonics.getAt(n, new Vector3()).toArray(), harmonics.getIrradianceAt(n, new Vector3()).toArray()];
});
console.log(JSON.stringify(values));
