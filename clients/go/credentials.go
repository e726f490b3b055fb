package stellate

import (
	"context"
	"crypto/tls"
	"crypto/x509"
	"net"
	"os"
	"strings"

	"google.golang.org/grpc"
	"google.golang.org/grpc/credentials"
	"google.golang.org/grpc/credentials/insecure"
	"google.golang.org/grpc/metadata"
)

// Credentials are TLS, and a token, for a server that wants them. Files are PEM.
type Credentials struct {
	Token       string // sent with every call; over plain text only within this machine
	CA          string // file with the authority that signed the server's certificate
	Certificate string // files with the client's own, for a server that asks for one
	Key         string
	TLS         bool // TLS with the system's authorities; implied by CA and Certificate
}

func (c Credentials) dialOptions(address string) ([]grpc.DialOption, error) {
	var options []grpc.DialOption
	if (c.Certificate == "") != (c.Key == "") {
		return nil, invalid("a client certificate and its key go together: give both")
	}
	if c.TLS || c.CA != "" || c.Certificate != "" {
		config, err := c.config()
		if err != nil {
			return nil, err
		}
		options = append(options, grpc.WithTransportCredentials(credentials.NewTLS(config)))
	} else {
		if c.Token != "" && !staysOnThisMachine(address) {
			return nil, invalid("the token would go to %s in plain text, for others to read and use: turn TLS on", address)
		}
		options = append(options, grpc.WithTransportCredentials(insecure.NewCredentials()))
	}
	if c.Token == "" {
		return options, nil
	}
	// Call credentials would be refused on plain text.
	with := func(ctx context.Context) context.Context {
		return metadata.AppendToOutgoingContext(ctx, "authorization", "Bearer "+c.Token)
	}
	return append(options,
		grpc.WithChainUnaryInterceptor(func(ctx context.Context, method string, request, reply any,
			connection *grpc.ClientConn, call grpc.UnaryInvoker, options ...grpc.CallOption) error {
			return call(with(ctx), method, request, reply, connection, options...)
		}),
		grpc.WithChainStreamInterceptor(func(ctx context.Context, about *grpc.StreamDesc, connection *grpc.ClientConn,
			method string, open grpc.Streamer, options ...grpc.CallOption) (grpc.ClientStream, error) {
			return open(with(ctx), about, connection, method, options...)
		})), nil
}

func (c Credentials) config() (*tls.Config, error) {
	config := &tls.Config{MinVersion: tls.VersionTLS12}
	if c.CA != "" {
		pem, err := os.ReadFile(c.CA)
		if err != nil {
			return nil, err
		}
		config.RootCAs = x509.NewCertPool()
		if !config.RootCAs.AppendCertsFromPEM(pem) {
			return nil, invalid("%s has no certificate in it", c.CA)
		}
	}
	if c.Certificate != "" {
		own, err := tls.LoadX509KeyPair(c.Certificate, c.Key)
		if err != nil {
			return nil, err
		}
		config.Certificates = []tls.Certificate{own}
	}
	return config, nil
}

// staysOnThisMachine says whether a server's address is a unix socket or the loopback.
func staysOnThisMachine(address string) bool {
	if strings.HasPrefix(address, "unix:") {
		return true
	}
	host, _, err := net.SplitHostPort(address)
	return err == nil && (host == "localhost" || net.ParseIP(host).IsLoopback())
}
