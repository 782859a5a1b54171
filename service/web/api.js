/** The service, as its own page speaks to it: nothing that a client could not do by curl. */

import { FINAL } from './words.js';

export class Refused extends Error {
  constructor(problem, status) {
    super(problem.detail ?? `the service answered ${status}`);
    this.code = problem.code ?? 'http_error';
    this.instance = problem.instance;
    this.status = status;
  }
}

const KEY = 'cusp-api-key';
const SILENT = { detail: 'The service does not answer; is it running?', code: 'no_answer' };
const RETRY_MS = 1000;
export const key = { get: () => sessionStorage.getItem(KEY) ?? '', set: (text) => sessionStorage.setItem(KEY, text) };

const headersOf = (given) => (key.get() ? { ...given, Authorization: `Bearer ${key.get()}` } : { ...given });

async function call(path, options = {}) {
  let answer;
  try {
    answer = await fetch(path, { ...options, headers: headersOf(options.headers) });
  } catch (error) {
    if (error.name === 'AbortError') throw error;
    throw new Refused(SILENT, 0);
  }
  if (!answer.ok) throw new Refused(await answer.json().catch(() => ({})), answer.status);
  return answer;
}

export const json = async (path, options) => (await call(path, options)).json();
export const bytes = async (path) => (await call(path)).arrayBuffer();
export const blob = async (path) => (await call(path)).blob();
export const stream = async (path) => (await call(path)).body;
export const cancel = (id) => call(`/v1/jobs/${id}/cancel`, { method: 'POST' });
export const remove = (path) => call(path, { method: 'DELETE' });
export const start = (request) => json('/v1/jobs', { method: 'POST', headers: { 'Content-Type': 'application/json' }, body: JSON.stringify(request) });

/** As `json`, telling the share that is sent: fetch cannot. onShare : called with 0 to 1 */
export function send(method, path, body, onShare) {
  return new Promise((resolve, reject) => {
    const request = new XMLHttpRequest();
    request.open(method, path);
    for (const [name, value] of Object.entries(headersOf())) request.setRequestHeader(name, value);
    request.upload.addEventListener('progress', (event) => { if (event.lengthComputable) onShare(event.loaded / event.total); });
    request.addEventListener('error', () => reject(new Refused(SILENT, 0)));
    request.addEventListener('load', () => {
      let answer = {};
      try { answer = JSON.parse(request.responseText); } catch { /* not ours: the status says it */ }
      if (request.status >= 200 && request.status < 300) resolve(answer);
      else reject(new Refused(answer, request.status));
    });
    request.send(body);
  });
}

/** Each change of a job, the last one final; begins again when the line is cut. */
export async function* watch(id, signal) {
  for (;;) {
    try {
      for await (const job of events(id, signal)) {
        yield job;
        if (FINAL.includes(job.status)) return;
      }
    } catch (error) {
      if (signal.aborted || (error instanceof Refused && error.status)) throw error;
    }
    await new Promise((resolve) => { setTimeout(resolve, RETRY_MS); });
    signal.throwIfAborted();
  }
}

/** By server-sent events read through fetch, which can carry a key. */
async function* events(id, signal) {
  const answer = await call(`/v1/jobs/${id}/events`, { signal });
  const reader = answer.body.pipeThrough(new TextDecoderStream()).getReader();
  let text = '';
  for (;;) {
    const { value, done } = await reader.read();
    if (done) return;
    text += value.replaceAll('\r\n', '\n');
    for (let end; (end = text.indexOf('\n\n')) >= 0; text = text.slice(end + 2)) {
      const data = text.slice(0, end).split('\n').filter((line) => line.startsWith('data:'));
      if (data.length) yield JSON.parse(data.map((line) => line.slice(5)).join('\n'));
    }
  }
}
