/** Elements of the page: found, made, filled. Text only ever goes in as text. */

export const $ = (id) => document.getElementById(id);

/** element('td', 'words', {className: 'number'}); content: text, an element, or several */
export function element(tag, content = '', properties = {}) {
  const made = document.createElement(tag);
  made.append(...[content].flat());
  return Object.assign(made, properties);
}

/** Fill a select with [value, text]. */
export function choices(select, pairs) {
  select.replaceChildren(...pairs.map(([value, text]) => element('option', text, { value })));
}

/** Fill a table: head a list of texts, rows lists of texts or elements; numbers : columns that stand to the right */
export function fill(table, head, rows, numbers = []) {
  const cell = (tag, content, k, more = {}) => element(tag, content, { className: numbers.includes(k) ? 'number' : '', ...more });
  table.replaceChildren(
    element('thead', element('tr', head.map((each, k) => cell('th', each, k, { scope: 'col' })))),
    element('tbody', rows.map((row) => element('tr', row.map((each, k) => cell('td', each, k))))),
  );
}

/** A figure of a list of figures: [name, value, what it is (a tooltip)]. */
export const figure = ([name, value, title = '']) => element('div', [element('dt', name), element('dd', value)], { title });

/** Show what went wrong where people look for it; a missing key opens the box for it. */
export function say(id, error) {
  $(id).replaceChildren(error.message);
  if (error.code && error.code !== 'http_error') $(id).append(element('small', ` (${error.code}${error.instance ? `, ${error.instance}` : ''})`));
  $(id).hidden = false;
  if (error.status === 401) {
    $('key-box').open = true;
    $('key').focus();
  }
}
