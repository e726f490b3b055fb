#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace stellate::pipe {

// `number` in plain decimal notation without an exponent, which bc takes too; exact.
void AppendNumber(double number, std::string* to);

// False unless all of `text` is one number: decimal, "inf" or "nan". Too small ones become zero.
bool ParseNumber(std::string_view text, double* number);

// The parts of `text` between separators, empty ones included.
std::vector<std::string_view> Split(std::string_view text, char separator);

// The words of `text`, which blanks separate.
std::vector<std::string_view> Words(std::string_view text);

// What came, fit to be shown: in quotes, at most 80 bytes, odd ones as \x1b.
std::string Quoted(std::string_view bytes);

}  // namespace stellate::pipe
