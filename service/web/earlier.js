/** Meshes of earlier jobs: a design is sent once and used for many scans. */

import * as api from './api.js';
import { choices, element } from './dom.js';
import { time } from './words.js';

const JOBS = 200; // the latest; what is older is found by its job
const FIRST = { design: ['design', 'mesh', 'scan'], scan: ['scan', 'mesh', 'design'], mesh: ['mesh', 'design', 'scan'] };
let known = new Map(); // blob -> {blob, filename}

/** Fill each select of `selects` (mesh name -> select) with what was sent before, its own kind first. */
export async function offer(selects) {
  const { jobs } = await api.json(`/v1/jobs?limit=${JOBS}`);
  const byRole = { design: new Map(), scan: new Map(), mesh: new Map() }; // role -> blob -> the latest use
  for (const job of jobs) {
    for (const [role, given] of Object.entries(job.inputs)) {
      if (given && !byRole[role].has(given.blob)) byRole[role].set(given.blob, { ...given, job });
    }
  }
  // The latest use of a mesh may have named it by its id alone: any name that it had is better than none.
  const names = new Map([...jobs].reverse().flatMap(({ inputs }) => Object.values(inputs)).filter((input) => input?.filename)
    .map(({ blob, filename }) => [blob, filename]));
  const blobs = Object.values(byRole).flatMap((uses) => [...uses.keys()]);
  known = new Map(blobs.map((blob) => [blob, { blob, filename: names.get(blob) ?? null }]));
  for (const [name, select] of Object.entries(selects)) {
    const chosen = select.value;
    choices(select, [['', known.size ? 'none' : 'none was sent yet']]);
    for (const role of FIRST[name]) {
      const offered = [...byRole[role].values()].map(({ blob, job }) => element('option', `${names.get(blob) ?? blob.slice(7, 15)} · ${job.label ? `${job.label} · ` : ''}${time(job.created)}`, { value: blob }));
      if (offered.length) select.append(element('optgroup', offered, { label: `used as ${role}` }));
    }
    if (known.has(chosen)) select.value = chosen;
  }
}

/** What a request says of the blob. */
export const reference = (blob) => known.get(blob) ?? { blob };
