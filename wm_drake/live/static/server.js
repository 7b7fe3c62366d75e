// Requests to the server that this page came from.

/** An answer with problems: what is wrong, each with the key of its value. */
export class Problems extends Error {
  constructor(problems, exists) {
    super(problems.map((problem) => problem.message).join('; '));
    this.problems = problems;
    this.exists = exists;
  }
}

async function answered(request) {
  let response;
  try {
    response = await request;
  } catch {
    throw new Error('the server does not answer; was it ended? What was saved is kept.');
  }
  const content = await response.json().catch(() => null);
  if (content === null) throw new Error(`the server answers with status ${response.status}`);
  if (content.problems) throw new Problems(content.problems, content.exists === true);
  return content;
}

export const get = (path) => answered(fetch(`api/${path}`));

export const post = (path, body) => answered(fetch(`api/${path}`, {
  method: 'POST', headers: {'Content-Type': 'application/json'}, body: JSON.stringify(body),
}));

/** Pages without a server return here how to go on at the command line. */
export const take = null;
