// What a person has chosen of the view, kept in this browser. A browser that keeps nothing shows what is usual.

/** The value that was kept under a name; "usual" if there is none. */
export function kept(name, usual) {
  try {
    return localStorage.getItem(`mav-tasks ${name}`) ?? usual;
  } catch {
    return usual;
  }
}

export function keep(name, value) {
  try {
    localStorage.setItem(`mav-tasks ${name}`, value);
  } catch { /* it is kept until the page is closed */ }
}
