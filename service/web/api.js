/** The service, as its own page speaks to it: nothing that a client could not do by curl. */

export class Refused extends Error {
  constructor(problem, status) {
    super(problem.detail ?? `the service answered ${status}`);
    this.code = problem.code ?? 'http_error';
    this.status = status;
  }
}

const KEY = 'cusp-api-key';
export const key = { get: () => sessionStorage.getItem(KEY) ?? '', set: (text) => sessionStorage.setItem(KEY, text) };

async function call(path, options = {}) {
  const headers = { ...options.headers };
  if (key.get()) headers.Authorization = `Bearer ${key.get()}`;
  let answer;
  try {
    answer = await fetch(path, { ...options, headers });
  } catch {
    throw new Refused({ detail: 'the service does not answer; is it running?', code: 'no_answer' }, 0);
  }
  if (!answer.ok) throw new Refused(await answer.json().catch(() => ({})), answer.status);
  return answer;
}

export const json = async (path, options) => (await call(path, options)).json();
export const bytes = async (path) => (await call(path)).arrayBuffer();
export const blob = async (path) => (await call(path)).blob();
export const remove = (path) => call(path, { method: 'DELETE' });

/** Each change of a job, the last one final. By server-sent events read through fetch, which can carry a key. */
export async function* watch(id, signal) {
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
