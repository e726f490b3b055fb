#include <cstring>
#include <optional>

#include "pipe/framing.h"
#include "pipe/numbers.h"

namespace stellate::pipe {
namespace {

constexpr std::uint32_t kTangents = 1, kSizes = 2, kFound = 4, kError = 8, kWalls = 16;
constexpr std::uint32_t kMostFlags = kTangents | kSizes | kFound | kWalls;

std::string Show(const Eigen::Ref<const Eigen::VectorXd>& numbers) {
  constexpr Eigen::Index kShown = 10;
  std::string shown = "(";
  for (Eigen::Index i = 0; i < std::min(kShown, numbers.size()); ++i) {
    char text[32];
    std::snprintf(text, sizeof text, "%s%.17g", i > 0 ? ", " : "", numbers[i]);
    shown += text;
  }
  return shown + (numbers.size() > kShown ? ", ...)" : ")");
}

std::string RowOf(Eigen::Index row, Eigen::Index rows) {
  return "row " + std::to_string(row + 1) + " of " + std::to_string(rows);
}

class BinaryReader final : public AnswerReader {
 public:
  explicit BinaryReader(const Question& question) : AnswerReader(question) {}

  bool Take(std::string* bytes) override {
    if (!flags_) {
      std::uint32_t head[2];
      if (bytes->size() < sizeof head) return false;
      std::memcpy(head, bytes->data(), sizeof head);
      Begin(head, *bytes);
      bytes->erase(0, sizeof head);
    }
    if (bytes->size() < body_) return false;
    if (*flags_ == kError) throw CommandError(bytes->substr(0, body_));
    Fill(bytes->data());
    bytes->erase(0, body_);
    return true;
  }

 private:
  void Begin(const std::uint32_t (&head)[2], const std::string& bytes) {
    const auto [count, flags] = head;
    if (flags == kError && count <= kMaxErrorBytes) {
      body_ = count;
    } else if ((flags & ~kMostFlags) != 0) {
      throw Garbled("an answer begins with its number of rows and its flags, 8 bytes; these are " +
                    Quoted(bytes) + "; does something else write to its standard output?");
    } else if (count != static_cast<std::uint64_t>(n())) {
      throw Garbled("it answers " + std::to_string(count) + " rows and was asked " +
                    std::to_string(n()));
    } else {
      const Eigen::Index numbers = d() + ((flags & kTangents) != 0 ? dk() : 0) +
                                   ((flags & kSizes) != 0 ? 1 : 0) +
                                   ((flags & kWalls) != 0 ? question_.wall_numbers() : 0);
      body_ = static_cast<size_t>(n()) *
              (sizeof(double) * static_cast<size_t>(numbers) + ((flags & kFound) != 0 ? 1 : 0));
    }
    flags_ = flags;
  }

  void Fill(const char* from) {
    const auto take = [&from](auto* to, Eigen::Index count) {
      const size_t size = sizeof *to * static_cast<size_t>(count);
      std::memcpy(to, from, size);
      from += size;
    };
    answer_.points.resize(d(), n());
    take(answer_.points.data(), d() * n());
    if ((*flags_ & kTangents) != 0) {
      answer_.tangents.resize(dk(), n());
      take(answer_.tangents.data(), dk() * n());
    }
    if ((*flags_ & kSizes) != 0) {
      answer_.sizes.resize(n());
      take(answer_.sizes.data(), n());
    }
    if ((*flags_ & kWalls) != 0 && question_.walls > 0) {
      MakeWalls();
      take(answer_.clearances.data(), answer_.clearances.size());
      take(answer_.conormals.data(), answer_.conormals.size());
    }
    if ((*flags_ & kFound) == 0) return;
    answer_.found.resize(static_cast<size_t>(n()));
    take(answer_.found.data(), n());
    for (size_t j = 0; j < answer_.found.size(); ++j) {
      if (answer_.found[j] > 1) {
        throw Garbled(RowOf(static_cast<Eigen::Index>(j), n()) + " has " +
                      std::to_string(answer_.found[j]) + " for found, which is 0 or 1");
      }
    }
  }

  std::optional<std::uint32_t> flags_;
  size_t body_ = 0;  // bytes
};

class TextReader final : public AnswerReader {
 public:
  explicit TextReader(const Question& question) : AnswerReader(question) {
    answer_.points.setZero(d(), n());
    answer_.found.assign(static_cast<size_t>(n()), 1);
  }

  bool Take(std::string* bytes) override {
    size_t taken = 0;
    while (row_ < n()) {
      const size_t end = bytes->find('\n', std::max(taken, searched_));
      if (end == std::string::npos) break;
      Row(std::string_view(*bytes).substr(taken, end - taken));
      taken = end + 1;
      searched_ = 0;
      ++row_;
    }
    bytes->erase(0, taken);
    searched_ = bytes->size();
    // Numbers of a row have some 25 bytes each, and never more than 400.
    const size_t longest = std::max(
        kMaxErrorBytes, 400 * static_cast<size_t>(d() + dk() + 1 + question_.wall_numbers()));
    if (row_ < n() && bytes->size() > longest) {
      throw Garbled(RowOf(row_, n()) + " does not end: " + Quoted(*bytes));
    }
    return row_ == n();
  }

 private:
  void Row(std::string_view line) {
    const std::vector<std::string_view> words = Words(line);
    const auto count = static_cast<Eigen::Index>(words.size());
    if (count == 1 && words[0] == "-") {
      answer_.found[static_cast<size_t>(row_)] = 0;
      return;
    }
    if (count > 0 && words[0] == "error")
      throw CommandError(std::string(line.substr(0, kMaxErrorBytes)));
    Settle(count, line);
    Eigen::Index at = 0;
    const auto take = [&](auto&& to) {
      for (Eigen::Index i = 0; i < to.size(); ++i, ++at) {
        const std::string_view word = words[static_cast<size_t>(at)];
        if (!ParseNumber(word, &to[i])) {
          throw Garbled(RowOf(row_, n()) + " has " + Quoted(word) + " for a number");
        }
      }
    };
    take(answer_.points.col(row_));
    if (answer_.tangents.size() > 0) take(answer_.tangents.col(row_));
    if (answer_.sizes.size() > 0) take(answer_.sizes.segment(row_, 1));
    if (question_.walls == 0) return;
    take(answer_.clearances.col(row_));
    if (!question_.face.empty()) take(answer_.conormals.col(row_));
  }

  // The first row that was found says what all have.
  void Settle(Eigen::Index count, std::string_view line) {
    if (!settled_) {
      const Eigen::Index own = count - question_.wall_numbers();
      const bool sizes = own == d() + 1 || own == d() + dk() + 1;
      const bool tangents = own == d() + dk() || own == d() + dk() + 1;
      if (question_.walls > 0) MakeWalls();
      if (tangents) answer_.tangents.setZero(dk(), n());
      if (sizes) answer_.sizes.setOnes(n());
      settled_ = tangents || sizes || own == d() ? count : 0;
    }
    if (count == *settled_ && count > 0) return;
    const bool first = *settled_ == 0;
    throw Garbled(RowOf(row_, n()) + " has " + std::to_string(count) + " numbers" +
                  (first ? ", not " + std::to_string(d()) + " of a point, " + std::to_string(dk()) +
                               " more of tangents or 1 more of a size" + OfWalls()
                         : ", and those before " + std::to_string(*settled_)) +
                  ": " + Quoted(line));
  }

  std::string OfWalls() const {
    if (question_.walls == 0) return "";
    return ", and " + std::to_string(question_.wall_numbers()) + " of walls after these";
  }

  Eigen::Index row_ = 0;
  size_t searched_ = 0;  // bytes that hold no end of a line
  std::optional<Eigen::Index> settled_;
};

}  // namespace

std::unique_ptr<AnswerReader> AnswerReader::Make(const Question& question, bool text) {
  if (text) return std::make_unique<TextReader>(question);
  return std::make_unique<BinaryReader>(question);
}

void AnswerReader::MakeWalls() {
  answer_.clearances.setZero(question_.walls, n());
  answer_.conormals.setZero(std::ssize(question_.face) * d(), n());
}

Answer AnswerReader::Finish() {
  const bool any = std::find(answer_.found.begin(), answer_.found.end(), 1) != answer_.found.end();
  const bool nothing = !answer_.found.empty() && !any;
  if (!question_.tangents) answer_.tangents.resize(0, 0);
  if (!question_.sizes) answer_.sizes.resize(0);
  if (nothing && question_.tangents) answer_.tangents.setZero(dk(), n());
  if (nothing && question_.sizes) answer_.sizes.setOnes(n());
  if (question_.tangents && answer_.tangents.size() == 0) {
    throw Garbled("it has no tangents in an answer that has to have them: its first line promised");
  }
  if (nothing && question_.walls > 0 && answer_.clearances.size() == 0) MakeWalls();
  if (question_.walls > 0 && answer_.clearances.size() == 0) {
    throw Garbled("it has no walls in an answer that has to have them: its first line promised");
  }
  if (question_.sizes && answer_.sizes.size() == 0) {
    throw Garbled("it has no sizes in an answer that has to have them: its first line promised");
  }
  for (Eigen::Index j = 0; j < n(); ++j) {
    if (!answer_.IsFound(j)) continue;
    const char* what = nullptr;
    if (!answer_.points.col(j).allFinite()) what = "a point";
    if (question_.tangents && !answer_.tangents.col(j).allFinite()) what = "tangents";
    if (question_.sizes && !std::isfinite(answer_.sizes[j])) what = "a size";
    if (question_.walls > 0 && !answer_.clearances.col(j).allFinite()) what = "a clearance";
    if (!question_.face.empty() && !answer_.conormals.col(j).allFinite()) what = "a conormal";
    if (what == nullptr) continue;
    throw Garbled(RowOf(j, n()) + " has " + what +
                  " that is not finite, and does not say that none was found: " +
                  Show(answer_.points.col(j)) + " for the query " + Show(question_.points.col(j)));
  }
  return std::move(answer_);
}

}  // namespace stellate::pipe
