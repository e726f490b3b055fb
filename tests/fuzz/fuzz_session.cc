// A session whose workers do what the input says: it ends, in order, with a history that fits; and
// if nobody lied and it succeeded, with the same mesh as ever.

#include "tests/fuzz/scripted_session.h"

namespace stellate::fuzz {

std::vector<std::string> Seeds() {
  std::vector<std::string> seeds{""};
  for (int act = 0; act < 32; ++act) {
    for (const std::size_t at : {1u, 6u, 20u}) {
      std::string script(at, '\0');
      script.push_back(static_cast<char>(128 + act));
      script += std::string("\1\2\0\0\0\0\0\0\xf0\x3f", 10);
      seeds.push_back(std::move(script));
    }
  }
  return seeds;
}

}  // namespace stellate::fuzz

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace stellate;
  static const std::string undisturbed = [] {
    server::Session session(fuzz::SmallSphere());
    fuzz::Script nothing(nullptr, 0);
    fuzz::Play(&session, &nothing);
    fuzz::Require(session.View().state == server::SessionState::kSucceeded, "truth is enough");
    return fuzz::GeometryOf(session);
  }();
  server::Session session(fuzz::SmallSphere());
  fuzz::Script script(data, size);
  const fuzz::Played played = fuzz::Play(&session, &script);
  const std::string geometry = fuzz::GeometryOf(session);
  if (played.truthful && session.View().state == server::SessionState::kSucceeded) {
    fuzz::Require(geometry == undisturbed, "who serves it, and how well, leaves no trace");
  }
  return 0;
}
