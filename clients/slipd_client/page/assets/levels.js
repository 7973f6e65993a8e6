// The levels: a word, a colour and a symbol each, so that no level is known by its colour alone.

/** Outline of each symbol, in a square of 48. */
const SYMBOLS = {
  no_contact: "M24 6a18 18 0 1 0 .01 0zm0 5a13 13 0 1 1-.01 0z",
  stable: "M20 40 6 26l5-5 9 9L37 9l6 5z",
  caution: "M24 5 45 42H3zM24 15 11 37h26z",
  warning: "M24 3 46 43H2zM21.500 16v14h5V16zM21.500 33v5h5v-5z",
  slipping: "M18 4h12v22h10L24 45 8 26h10z",
  unknown:
    "M14 17C14 9 18 4 25 4c7 0 11 5 11 11 0 9-9 9-9 17h-7c0-11 8-12 8-17 0-2-1-4-4-4-3 0-4 3-4 6zM20 37h7v7h-7z",
};

export const LEVELS = Object.keys(SYMBOLS);

/** The level of a message; a word that this page does not know is "unknown". */
export const known = (level) => (LEVELS.includes(level) ? level : "unknown");

/** The word for people. */
export const word = (level) => String(level).replaceAll("_", " ").toUpperCase();

/** Show a level on a banner: its colour comes from the style sheet. */
export function showLevel(banner, level) {
  const shown = known(level);
  if (banner.dataset.level !== shown || !banner.dataset.drawn) {
    banner.dataset.level = shown;
    banner.dataset.drawn = "1";
    const path = banner.querySelector("path");
    path.setAttribute("d", SYMBOLS[shown]);
    path.setAttribute("fill-rule", "evenodd");
  }
}
