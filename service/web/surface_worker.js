/** Reads a file of the viewer and prepares its surface, beside the page so that it never stalls: millimetres, normals, areas, extremes, coarser
 *  levels, and a tree of its triangles. */

import { BufferAttribute, BufferGeometry } from './vendor/three/three.module.js';
import { GLTFLoader } from './vendor/three/GLTFLoader.js';
import { CENTER, MeshBVH } from './vendor/three_mesh_bvh/index.module.js';
import { isCounted } from './colours.js';
import { areas, inMillimetres, surface } from './geometry.js';
import { ofCloud, ofMesh } from './levels.js';
import * as ply from './ply.js';

const GREY = 170; // of a mesh without colours

onmessage = async ({ data: { file, kind } }) => {
  try {
    const made = prepared(kind === 'glb' ? await fromGlb(file) : fromPly(file));
    const arrays = [made.positions, made.normals, made.colours, made.values, made.areas, made.index, ...made.levels].filter(Boolean);
    postMessage({ made }, [...new Set([...arrays.map(({ buffer }) => buffer), ...(made.roots ?? [])])]);
  } catch (error) {
    postMessage({ error: error.message });
  }
};

async function fromGlb(file) {
  const { isPoints, geometry } = inMillimetres(surface(await new GLTFLoader().parseAsync(file, '')));
  const { position, color, _deviation_mm: deviation } = geometry.attributes;
  return {
    isCloud: Boolean(isPoints),
    positions: position.array,
    colours: color ? bytes(color) : null,
    values: deviation?.array ?? null,
    index: geometry.index ? Uint32Array.from(geometry.index.array) : null,
  };
}

function fromPly(file) {
  const { positions, colours, index } = ply.parse(file);
  const isCloud = !index.length;
  return { isCloud, positions, colours: colours && bytes(new BufferAttribute(colours, 3, true)), values: null, index: isCloud ? null : index };
}

/** (4 n) of 255, four to a vertex as graphics cards want it */
function bytes(colour) {
  const found = new Uint8Array(4 * colour.count).fill(255);
  const [get, step] = [colour.array, colour.itemSize];
  const factor = get instanceof Uint8Array ? 1 : get instanceof Uint16Array ? 1 / 257 : 255;
  for (let k = 0; k < colour.count; k += 1) for (let part = 0; part < 3; part += 1) found[4 * k + part] = get[k * step + part] * factor;
  return found;
}

function prepared({ isCloud, positions, colours, values, index }) {
  const count = positions.length / 3;
  const made = { isCloud, positions, values, index, normals: null, roots: null, colours: colours ?? new Uint8Array(4 * count).fill(GREY) };
  const geometry = new BufferGeometry();
  geometry.setAttribute('position', new BufferAttribute(positions, 3));
  if (!isCloud) {
    geometry.setIndex(new BufferAttribute(index ?? Uint32Array.from({ length: count }, (_, k) => k), 1));
    geometry.computeVertexNormals();
    made.normals = geometry.attributes.normal.array;
    const { roots, index: sorted } = MeshBVH.serialize(new MeshBVH(geometry, { strategy: CENTER }), { cloneBuffers: false });
    Object.assign(made, { roots, index: sorted });
  }
  made.areas = areas(geometry);
  made.levels = isCloud ? ofCloud(count) : ofMesh(positions, made.normals, made.index);
  made.extremes = values ? extremes(values) : [];
  return made;
}

/** The vertices of the smallest and the largest value; none where nothing is counted. */
function extremes(values) {
  let [low, high] = [-1, -1];
  for (let k = 0; k < values.length; k += 1) {
    if (!isCounted(values[k])) continue;
    if (low < 0 || values[k] < values[low]) low = k;
    if (high < 0 || values[k] > values[high]) high = k;
  }
  return low < 0 ? [] : [low, high];
}
