/**
 * C's %.{digits}g: the same text from all clients; with 17 digits it comes back to the same double, and of
 * two decimals that are equally near it takes the even one, where JavaScript takes the larger.
 */
export function general(value: number, digits: number): string {
  if (value === 0) return Object.is(value, -0) ? "-0" : "0";
  const [mantissa, power] = exponential(Math.abs(value), digits).split("e");
  const exponent = Number(power);
  const minus = value < 0 ? "-" : "";
  const trimmed = (text: string) =>
    minus + (text.includes(".") ? text.replace(/\.?0*$/, "") : text);
  if (exponent < -4 || exponent >= digits) {
    const sign = exponent < 0 ? "-" : "+";
    return `${trimmed(mantissa)}e${sign}${String(Math.abs(exponent)).padStart(2, "0")}`;
  }
  const all = "0".repeat(Math.max(0, -exponent)) + mantissa.replace(".", "");
  const whole = Math.max(0, exponent) + 1;
  return trimmed(`${all.slice(0, whole)}.${all.slice(whole)}`);
}

function exponential(value: number, digits: number): string {
  const whole = value.toExponential(100);
  const kept = whole.slice(0, whole.indexOf(".") + digits);
  const even = Number(kept.at(-1)) % 2 === 0;
  const halfWay = /^50*e/.test(whole.slice(kept.length));
  if (halfWay && even) return kept + whole.slice(whole.indexOf("e"));
  return value.toExponential(digits - 1);
}
