#pragma once

#include <algorithm>
#include <random>
#include <string>
#include <vector>

namespace stellate::testing {

// Damages inputs as strangers and broken disks do; which ones follows from a number.
class Mutator {
 public:
  Mutator(std::vector<std::string> seeds, unsigned seed)
      : seeds_(std::move(seeds)), random_(seed) {}

  // One of the seeds, damaged.
  std::string Next() { return Damaged(Pick()); }

  std::string Damaged(std::string input) {
    for (auto edits = 1 + Below(8); edits > 0; --edits) Edit(&input);
    return input;
  }

 private:
  std::size_t Below(std::size_t n) { return n == 0 ? 0 : random_() % n; }
  const std::string& Pick() { return seeds_[Below(seeds_.size())]; }

  void Edit(std::string* input) {
    const std::size_t at = Below(input->size() + 1);
    const std::size_t length = Below(std::min<std::size_t>(input->size() - at, 64) + 1);
    switch (Below(7)) {
      case 0:
        if (at < input->size()) (*input)[at] = static_cast<char>(random_());
        break;
      case 1:
        if (at < input->size()) (*input)[at] ^= static_cast<char>(1 << Below(8));
        break;
      case 2:
        input->insert(at, 1 + Below(8), static_cast<char>(random_()));
        break;
      case 3:
        input->erase(at, length);
        break;
      case 4:
        input->insert(at, input->substr(at, length));
        break;
      case 5: {
        const std::string& other = Pick();
        input->insert(at, other.substr(Below(other.size()), 64));
        break;
      }
      case 6:  // what lengths and counts go wrong at
        input->replace(at, length, Below(2) == 0 ? 4 : 8, Below(2) == 0 ? '\xff' : '\x7f');
        break;
    }
  }

  const std::vector<std::string> seeds_;
  std::mt19937 random_;
};

}  // namespace stellate::testing
