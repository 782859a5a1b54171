/** The files of a job to take away. */

import * as api from './api.js';
import { element } from './dom.js';
import { size } from './words.js';

const WHAT = {
  'report.html': 'the report, to print',
  'results.json': 'all numbers',
  'deviation.ply': 'coloured scan',
  'deviation.glb': 'coloured scan, light',
  'design.glb': 'design with segments, light',
  'aligned.ply': 'scan on the design',
  'landmarks.csv': 'landmarks',
  'trials.csv': 'every trial',
};

export function list(files) {
  const order = Object.keys(WHAT);
  const rank = ({ name }) => (order.indexOf(name) + order.length + 1) % (order.length + 1);
  return [...files].sort((a, b) => rank(a) - rank(b) || a.name.localeCompare(b.name)).map(item);
}

function item(file) {
  const link = element('a', file.name, { href: file.href });
  if (file.name === 'report.html' && !api.key.get()) link.target = '_blank';
  else link.download = file.name;
  if (api.key.get()) {
    link.addEventListener('click', async (event) => { // a link cannot carry a key
      event.preventDefault();
      const address = URL.createObjectURL(await api.blob(file.href));
      element('a', '', { href: address, download: file.name }).click();
      setTimeout(() => URL.revokeObjectURL(address), 60_000);
    });
  }
  return element('li', [link, element('span', ` ${[WHAT[file.name], size(file.size)].filter(Boolean).join(', ')}`, { className: 'soft' })]);
}
