#pragma once

#include <string>
#include <string_view>

namespace stellate::text {

// Sanitizes untrusted text for terminals and logs. Returns UTF-8 without control characters, forged
// lines or changes of direction: `stand_in` (ASCII) for each control (C0, DEL, C1), each separator
// of lines or paragraphs, each character that sets the direction of writing (U+061C, U+200E-F,
// U+202A-E, U+2066-9), and each run of bytes that is no UTF-8.
std::string Printable(std::string_view text, char stand_in = ' ');

// The same for each line. Lines after the first are indented, so that none can be mistaken for one
// of the program's.
std::string PrintableLines(std::string_view text, char stand_in = ' ');

}  // namespace stellate::text
