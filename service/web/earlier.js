/** Meshes of earlier jobs: a design is sent once and used for many scans. */

import * as api from './api.js';
import { choices, element } from './dom.js';
import { time } from './words.js';

const JOBS = 200; // the latest; what is older is found by its job
const FIRST = { design: ['design', 'mesh', 'scan'], scan: ['scan', 'mesh', 'design'], mesh: ['mesh', 'design', 'scan'] };
let names = { design: new Map(), scan: new Map(), mesh: new Map() }; // role -> blob -> the latest file name

/** Fill each select of `selects` (mesh name -> select) with what was sent before, its own kind first. */
export async function offer(selects) {
  const { jobs } = await api.json(`/v1/jobs?limit=${JOBS}`);
  const uses = { design: new Map(), scan: new Map(), mesh: new Map() }; // role -> blob -> the latest use
  names = { design: new Map(), scan: new Map(), mesh: new Map() };
  for (const job of jobs) {
    for (const [role, input] of Object.entries(job.inputs)) {
      if (input && !uses[role].has(input.blob)) uses[role].set(input.blob, { blob: input.blob, job });
      if (input?.filename && !names[role].has(input.blob)) names[role].set(input.blob, input.filename);
    }
  }
  const known = new Set(Object.values(uses).flatMap((found) => [...found.keys()]));
  for (const [name, select] of Object.entries(selects)) {
    const chosen = select.value;
    choices(select, [['', known.size ? 'none' : 'none was sent yet']]);
    for (const role of FIRST[name]) {
      const offered = [...uses[role].values()].map(({ blob, job }) => element('option', `${nameOf(role, blob) ?? blob.slice(7, 15)} · ${job.label ? `${job.label} · ` : ''}${time(job.created)}`, { value: blob }));
      if (offered.length) select.append(element('optgroup', offered, { label: `used as ${role}` }));
    }
    if (known.has(chosen)) select.value = chosen;
  }
}

/** The name that a mesh had in this role, else in another: its latest use may have named it by its id alone. */
const nameOf = (role, blob) => FIRST[role].map((each) => names[each].get(blob)).find(Boolean) ?? null;

/** What a request says of the blob that is used in this role. */
export const reference = (role, blob) => ({ blob, filename: nameOf(role, blob) });
