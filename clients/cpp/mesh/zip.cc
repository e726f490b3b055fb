// The records of PKWARE's APPNOTE.TXT 6.3, sections 4.3.7 to 4.3.16.
#include "mesh/zip.h"

#include <zlib.h>

#include <algorithm>
#include <limits>
#include <new>
#include <utility>

namespace stellate::client {
namespace {

constexpr std::uint64_t kElsewhere = 0xFFFFFFFF;
constexpr std::uint16_t kPlain = 20, kZip64 = 45;  // versions that a reader has to know

template <typename Number>
void Append(std::string* to, Number number) {
  to->append(reinterpret_cast<const char*>(&number), sizeof number);  // little endian
}

std::string Deflated(std::string_view bytes) {
  z_stream stream = {};
  constexpr int kBare = -MAX_WBITS;  // without zlib's own head and sum
  constexpr int kMemory = 8;         // zlib's default
  if (deflateInit2(&stream, Z_DEFAULT_COMPRESSION, Z_DEFLATED, kBare, kMemory,
                   Z_DEFAULT_STRATEGY) != Z_OK) {
    throw std::bad_alloc();
  }
  std::string deflated, block(std::size_t{1} << 16, '\0');
  for (int state = Z_OK; state == Z_OK;) {
    // zlib counts in 32 bits.
    const auto some = static_cast<uInt>(
        std::min<std::size_t>(bytes.size(), std::numeric_limits<uInt>::max() / 2));
    stream.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(bytes.data()));
    stream.avail_in = some;
    stream.next_out = reinterpret_cast<Bytef*>(block.data());
    stream.avail_out = static_cast<uInt>(block.size());
    state = deflate(&stream, some == bytes.size() ? Z_FINISH : Z_NO_FLUSH);
    bytes.remove_prefix(some - stream.avail_in);
    deflated.append(block, 0, block.size() - stream.avail_out);
  }
  deflateEnd(&stream);
  return deflated;
}

}  // namespace

void Zip::Add(std::string_view name, std::string_view bytes) {
  const std::string deflated = Deflated(bytes);
  const auto sum = static_cast<std::uint32_t>(
      crc32_z(0, reinterpret_cast<const Bytef*>(bytes.data()), bytes.size()));
  const std::uint64_t place = bytes_.size();
  const bool is_large = std::max<std::uint64_t>(bytes.size(), deflated.size()) > largest_;
  const bool is_far = place > largest_;
  const auto extra_bytes = [](int numbers) {
    return static_cast<std::uint16_t>(numbers == 0 ? 0 : 4 + 8 * numbers);
  };
  // What both records of a file begin with, and 64-bit numbers at the end of each.
  const auto add_common = [&](std::string* to, std::uint16_t version, std::uint16_t extra) {
    Append(to, version);
    Append(to, std::uint16_t{0});           // flags
    Append(to, std::uint16_t{Z_DEFLATED});  // method
    Append(to, std::uint16_t{0});           // midnight
    Append(to, std::uint16_t{1 << 5 | 1});  // of January 1 of year 0, which is 1980
    Append(to, sum);
    Append(to, static_cast<std::uint32_t>(is_large ? kElsewhere : deflated.size()));
    Append(to, static_cast<std::uint32_t>(is_large ? kElsewhere : bytes.size()));
    Append(to, static_cast<std::uint16_t>(name.size()));
    Append(to, extra);
  };
  const auto add_extra = [&](std::string* to, std::uint16_t extra, bool has_place) {
    if (extra == 0) return;
    Append(to, std::uint16_t{1});  // ZIP64's
    Append(to, static_cast<std::uint16_t>(extra - 4));
    if (is_large) Append(to, static_cast<std::uint64_t>(bytes.size()));
    if (is_large) Append(to, static_cast<std::uint64_t>(deflated.size()));
    if (has_place) Append(to, place);
  };

  const std::uint16_t beside = extra_bytes(is_large ? 2 : 0);
  bytes_ += "PK\3\4";
  add_common(&bytes_, is_large ? kZip64 : kPlain, beside);
  bytes_ += name;
  add_extra(&bytes_, beside, false);
  bytes_ += deflated;

  const std::uint16_t listed = extra_bytes((is_large ? 2 : 0) + (is_far ? 1 : 0));
  const std::uint16_t version = listed > 0 ? kZip64 : kPlain;
  directory_ += "PK\1\2";
  Append(&directory_, version);  // by which it is made
  add_common(&directory_, version, listed);
  directory_.append(2 + 2 + 2 + 4, '\0');  // no comment, the first disk, no attributes
  Append(&directory_, static_cast<std::uint32_t>(is_far ? kElsewhere : place));
  directory_ += name;
  add_extra(&directory_, listed, is_far);
  ++files_;
}

std::string Zip::Finish() {
  const std::uint64_t place = bytes_.size(), size = directory_.size();
  const bool is_far = std::max(place, size) > largest_;
  bytes_ += directory_;
  if (is_far) {
    const std::uint64_t end = bytes_.size();
    bytes_ += "PK\6\6";
    Append(&bytes_, std::uint64_t{44});  // bytes that follow
    Append(&bytes_, kZip64);
    Append(&bytes_, kZip64);
    bytes_.append(4 + 4, '\0');  // this disk, that of the directory
    for (const std::uint64_t number : {files_, files_, size, place}) Append(&bytes_, number);
    bytes_ += "PK\6\7";
    Append(&bytes_, std::uint32_t{0});
    Append(&bytes_, end);
    Append(&bytes_, std::uint32_t{1});  // disks
  }
  bytes_ += "PK\5\6";
  bytes_.append(2 + 2, '\0');  // this disk, that of the directory
  const auto files = static_cast<std::uint16_t>(files_);
  Append(&bytes_, files);
  Append(&bytes_, files);
  Append(&bytes_, static_cast<std::uint32_t>(is_far ? kElsewhere : size));
  Append(&bytes_, static_cast<std::uint32_t>(is_far ? kElsewhere : place));
  bytes_.append(2, '\0');  // no comment
  return std::move(bytes_);
}

}  // namespace stellate::client
