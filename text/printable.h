#pragma once

#include <string>
#include <string_view>

namespace stellate::text {

// `text` as UTF-8 that commands no terminal, forges no line and is read in the order in which it
// is written: `stand_in` (ASCII) for each control (C0, DEL, C1), each separator of lines or
// paragraphs, each character that sets the direction of writing (U+061C, U+200E-F, U+202A-E,
// U+2066-9), and each run of bytes that is no UTF-8.
std::string Printable(std::string_view text, char stand_in = ' ');

// The same of each line. Lines after the first are indented, so that none of them can be taken for
// one that the program wrote.
std::string PrintableLines(std::string_view text, char stand_in = ' ');

}  // namespace stellate::text
