// The moment that is shown: now, or one of the past.
export function MomentBar() {
  return null;
}
