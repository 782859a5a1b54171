/** Binary PLY as Open3D writes it: vertices with colours, triangles. Nothing of the rest of the format. */

const BYTES = { char: 1, uchar: 1, int8: 1, uint8: 1, short: 2, ushort: 2, int: 4, uint: 4, int32: 4, uint32: 4, float: 4, float32: 4, double: 8, float64: 8 };
const READ = { uchar: 'getUint8', uint8: 'getUint8', int: 'getInt32', int32: 'getInt32', uint: 'getUint32', uint32: 'getUint32', float: 'getFloat32', float32: 'getFloat32', double: 'getFloat64', float64: 'getFloat64' };

/** ArrayBuffer -> {positions (3n), colours (3n, of 255) or null, index (3m)} */
export function parse(buffer) {
  const text = new TextDecoder('latin1').decode(new Uint8Array(buffer, 0, Math.min(buffer.byteLength, 4096)));
  const end = text.indexOf('end_header\n');
  if (!text.startsWith('ply') || end < 0 || !/^format binary_little_endian/m.test(text)) throw new Error('the file is no binary PLY');
  const elements = [];
  for (const line of text.slice(0, end).split('\n')) {
    const [word, ...rest] = line.trim().split(/\s+/);
    if (word === 'element') elements.push({ name: rest[0], count: Number(rest[1]), properties: [] });
    if (word === 'property') elements.at(-1).properties.push(rest);
  }
  const view = new DataView(buffer);
  let offset = end + 'end_header\n'.length;
  const found = { positions: new Float32Array(), colours: null, index: new Uint32Array() };
  for (const { name, count, properties } of elements) {
    if (name === 'vertex') {
      const stride = properties.reduce((sum, [type]) => sum + BYTES[type], 0);
      const column = (wanted) => {
        let at = 0;
        for (const [type, called] of properties) {
          if (called === wanted) return { at, get: READ[type] };
          at += BYTES[type];
        }
        return null;
      };
      const copy = (names, target) => {
        names.map(column).forEach(({ at, get }, part) => {
          for (let k = 0; k < count; k += 1) target[3 * k + part] = view[get](offset + k * stride + at, true);
        });
        return target;
      };
      found.positions = copy(['x', 'y', 'z'], new Float32Array(3 * count));
      if (column('red')) found.colours = copy(['red', 'green', 'blue'], new Uint8Array(3 * count));
      offset += count * stride;
    } else if (name === 'face') {
      const [, lengthType, type] = properties[0];
      found.index = new Uint32Array(3 * count);
      const step = BYTES[lengthType] + 3 * BYTES[type];
      for (let k = 0; k < 3 * count; k += 1) {
        found.index[k] = view[READ[type]](offset + Math.floor(k / 3) * step + BYTES[lengthType] + (k % 3) * BYTES[type], true);
      }
      offset += count * step;
    }
  }
  return found;
}
