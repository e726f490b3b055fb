#include "call_socket.h"

#include <google/protobuf/struct.pb.h>
#include <google/protobuf/util/json_util.h>

#include <algorithm>
#include <array>
#include <boost/asio/buffer.hpp>
#include <boost/asio/executor_work_guard.hpp>
#include <boost/asio/post.hpp>
#include <boost/asio/steady_timer.hpp>
#include <boost/beast/core/buffers_to_string.hpp>
#include <boost/beast/core/flat_buffer.hpp>
#include <boost/beast/websocket.hpp>
#include <charconv>
#include <chrono>
#include <deque>
#include <initializer_list>
#include <utility>
#include <vector>

#include "wire/status.h"

namespace stellate::view {
namespace {

namespace asio = boost::asio;
namespace beast = boost::beast;
namespace websocket = beast::websocket;
using boost::system::error_code;

constexpr std::size_t kMostUnderWay = std::size_t{4} << 20;
constexpr auto kProofTime = std::chrono::seconds(15);  // until a page has shown its proof
constexpr std::size_t kMostRequestBytes = std::size_t{1} << 16;

using Fields = std::initializer_list<std::pair<const char*, std::string>>;

std::string Json(const google::protobuf::Struct& object) {
  std::string text;
  // A Struct always has a JSON form.
  (void)google::protobuf::util::MessageToJsonString(object, &text).ok();
  return text;
}

std::string Json(Fields fields) {
  google::protobuf::Struct object;
  for (const auto& [name, value] : fields) (*object.mutable_fields())[name].set_string_value(value);
  return Json(object);
}

std::string End(grpc::StatusCode code, const std::string& message) {
  google::protobuf::Struct object;
  google::protobuf::Struct& end = *(*object.mutable_fields())["end"].mutable_struct_value();
  (*end.mutable_fields())["code"].set_number_value(code);
  (*end.mutable_fields())["message"].set_string_value(message);
  return Json(object);
}

grpc::ByteBuffer Bytes(const beast::flat_buffer& buffer) {
  const grpc::Slice slice(buffer.cdata().data(), buffer.cdata().size());
  return {&slice, 1};
}

class CallSocket;

// A call under way. gRPC's threads tell it, and it tells the socket on the socket's own. It is over
// only when it has been read to its end, so that whoever reads on finds it there.
class Call final : public grpc::ClientBidiReactor<grpc::ByteBuffer, grpc::ByteBuffer> {
 public:
  Call(Shared& shared, std::shared_ptr<CallSocket> socket, const std::string& method,
       const grpc::ByteBuffer& request);

  void ReadOn() { StartRead(&response_); }
  void Cancel() { context_.TryCancel(); }

  void OnReadDone(bool ok) override;
  void OnDone(const grpc::Status& status) override;

 private:
  asio::io_context& io_;
  const asio::executor_work_guard<asio::io_context::executor_type> work_;
  std::shared_ptr<CallSocket> socket_;
  grpc::ClientContext context_;
  const grpc::ByteBuffer request_;
  grpc::ByteBuffer response_;
};

class CallSocket : public std::enable_shared_from_this<CallSocket> {
 public:
  CallSocket(Shared& shared, beast::tcp_stream stream, HttpRequest request)
      : shared_(shared),
        stream_(std::move(stream)),
        request_(std::move(request)),
        patience_(shared.io),
        host_(request_[beast::http::field::host]),
        nonce_(NewSecret()) {}

  void Start() {
    shared_.sockets.Open(this, [this] { Leave(); });
    patience_.expires_after(kProofTime);
    patience_.async_wait([self = shared_from_this()](error_code) {
      if (!self->trusted_) self->Leave();
    });
    beast::get_lowest_layer(stream_).expires_never();
    stream_.set_option(websocket::stream_base::timeout::suggested(beast::role_type::server));
    stream_.read_message_max(kMostRequestBytes);
    stream_.async_accept(request_, [self = shared_from_this()](error_code error) {
      if (error) return self->Leave();
      self->SendText(Json({{"nonce", self->nonce_}}));
      self->Read();
    });
  }

  // On gRPC's word.
  void Take(const grpc::ByteBuffer& response) {
    std::vector<grpc::Slice> slices;
    if (gone_ || !response.Dump(&slices).ok()) {
      Leave();
      return call_->ReadOn();
    }
    under_way_ += response.Length();
    Send({std::move(slices), false});
    paused_ = under_way_ >= kMostUnderWay;
    if (!paused_) call_->ReadOn();
  }

  void Over(const grpc::Status& status) {
    call_ = nullptr;
    if (!gone_) Finish(status.error_code(), status.ok() ? "" : client::FromStatus(status).message);
  }

 private:
  void Finish(grpc::StatusCode code, const std::string& message) {
    SendText(End(code, message));
    closing_ = true;
    if (!writing_) Close();
  }

  struct Message {
    std::vector<grpc::Slice> slices;
    bool text = false;
  };

  void SendText(const std::string& text) { Send({{grpc::Slice(text)}, true}); }

  void Send(Message message) {
    queue_.push_back(std::move(message));
    if (!writing_) Write();
  }

  void Write() {
    writing_ = true;
    std::vector<asio::const_buffer> buffers;
    for (const grpc::Slice& slice : queue_.front().slices)
      buffers.emplace_back(slice.begin(), slice.size());
    stream_.text(queue_.front().text);
    stream_.async_write(buffers, [self = shared_from_this()](error_code error, std::size_t) {
      self->writing_ = false;
      if (error || self->gone_) return self->Leave();
      self->queue_.pop_front();
      if (!self->queue_.empty()) return self->Write();
      if (self->closing_) self->Close();
    });
  }

  void Read() {
    input_.clear();
    stream_.async_read(input_, [self = shared_from_this()](error_code error, std::size_t) {
      if (error || self->gone_) return self->Leave();
      self->Hear();
      if (!self->gone_) self->Read();
    });
  }

  void Hear() {
    if (closing_) return;  // it need not hear us out
    if (!trusted_) return Meet();
    if (call_ == nullptr) {
      if (!stream_.got_binary()) return Leave();
      call_ = new Call(shared_, shared_from_this(), Method(), Bytes(input_));  // until its OnDone
      return;
    }
    const std::string text = beast::buffers_to_string(input_.data());
    std::size_t bytes = 0;
    const auto [end, fault] = std::from_chars(text.data(), text.data() + text.size(), bytes);
    if (fault != std::errc() || end != text.data() + text.size() || bytes > under_way_)
      return Leave();
    under_way_ -= bytes;
    if (!paused_ || under_way_ >= kMostUnderWay) return;
    paused_ = false;
    call_->ReadOn();
  }

  void Meet() {
    const std::string text = beast::buffers_to_string(input_.data());
    const std::size_t space = text.find(' ');
    if (space == std::string::npos) return Leave();
    const std::string proof = text.substr(0, space), nonce = text.substr(space + 1);
    const auto known = shared_.keys.Knows(proof, host_, nonce_);
    if (!known) {
      return Finish(grpc::StatusCode::UNAUTHENTICATED,
                    "this page's address is not, or no longer, good here: open the one that "
                    "`stellate view` printed");
    }
    trusted_ = true;
    shared_.sockets.Trust(this);
    patience_.cancel();
    SendText(Json({{"proof", Proof(*known, "gateway", host_, nonce)},
                   {"server", shared_.title},
                   {"mesh", shared_.mesh},
                   {"secret", shared_.keys.secret()}}));
  }

  std::string Method() const {
    const auto target = request_.target();
    return std::string(target.substr(target.rfind('/') + 1));
  }

  void Close() {
    stream_.async_close(websocket::close_code::normal,
                        [self = shared_from_this()](error_code) { self->Leave(); });
  }

  void Leave() {
    if (gone_) return;
    gone_ = true;
    if (call_ != nullptr) call_->Cancel();
    if (paused_ && call_ != nullptr) call_->ReadOn();
    error_code ignored;
    beast::get_lowest_layer(stream_).socket().close(ignored);
    patience_.cancel();
    shared_.sockets.Close(this);
  }

  Shared& shared_;
  websocket::stream<beast::tcp_stream> stream_;
  const HttpRequest request_;
  asio::steady_timer patience_;  // with a stranger
  const std::string host_, nonce_;
  beast::flat_buffer input_;
  std::deque<Message> queue_;
  Call* call_ = nullptr;
  std::size_t under_way_ = 0;  // bytes that the page has not taken in
  bool writing_ = false, trusted_ = false, paused_ = false, closing_ = false, gone_ = false;
};

Call::Call(Shared& shared, std::shared_ptr<CallSocket> socket, const std::string& method,
           const grpc::ByteBuffer& request)
    : io_(shared.io),
      work_(asio::make_work_guard(shared.io)),
      socket_(std::move(socket)),
      request_(request) {
  shared.stub->PrepareBidiStreamingCall(&context_, "/stellate.v1.Stellate/" + method,
                                        grpc::StubOptions(), this);
  StartWriteLast(&request_, grpc::WriteOptions());
  StartRead(&response_);
  AddHold();
  StartCall();
}

void Call::OnReadDone(bool ok) {
  if (!ok) return RemoveHold();  // OnDone follows
  asio::post(io_, [socket = socket_, response = response_] { socket->Take(response); });
}

void Call::OnDone(const grpc::Status& status) {
  asio::post(io_, [this, status] {
    socket_->Over(status);
    delete this;
  });
}

}  // namespace

bool IsCall(std::string_view method) {
  constexpr std::array<std::string_view, 4> kCalls = {"ListMeshes", "GetMesh", "WatchMesh",
                                                      "DownloadMesh"};
  return std::find(kCalls.begin(), kCalls.end(), method) != kCalls.end();
}

void ServeCall(Shared& shared, beast::tcp_stream stream, HttpRequest request) {
  std::make_shared<CallSocket>(shared, std::move(stream), std::move(request))->Start();
}

}  // namespace stellate::view
