// The page's elements, and its colours.
export const at = <T extends HTMLElement>(id: string) => document.getElementById(id) as T;

// Of the theme that holds now.
export const css = (name: string) =>
  getComputedStyle(document.documentElement).getPropertyValue(name).trim();
