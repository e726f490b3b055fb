package stellate

import (
	"context"

	pb "stellate/proto/v1"
)

// Check probes an oracle for its contract, before a mesh is made of its answers; what the oracle
// returns as an error is a finding, too. epsilon is what a mesh is planned with, 0: nothing yet. A
// private server asks the questions; doctor.proto says what the report has. See Client.Check for
// another server.
func Check(ctx context.Context, oracle Oracle, epsilon float64) (*pb.CheckReport, error) {
	server, err := StartServer(ServerOptions{})
	if err != nil {
		return nil, err
	}
	defer server.Close()
	client, err := NewClient(Connection{Own: server})
	if err != nil {
		return nil, err
	}
	defer client.Close()
	return client.Check(ctx, oracle, epsilon)
}

// Check has this server examine an oracle: see the function Check.
func (c *Client) Check(ctx context.Context, oracle Oracle, epsilon float64) (*pb.CheckReport, error) {
	checked, err := check(oracle)
	if err != nil {
		return nil, err
	}
	within, cancel := context.WithCancel(ctx)
	defer cancel()
	spec := meshSpec(checked, epsilon, &Options{}, false)
	stream, err := c.stub.Examine(within, &pb.ExamineRequest{Spec: spec})
	if err != nil {
		return nil, fromRPC(err)
	}
	var failure error
	for {
		response, err := stream.Recv()
		if err != nil {
			if failure != nil {
				return nil, failure // there was no examination
			}
			return nil, fromRPC(err)
		}
		if mesh := response.GetMesh(); mesh != nil {
			_, failure = c.Serve(ctx, oracle, mesh.GetName(), WorkerOptions{})
		}
		if report := response.GetReport(); report != nil {
			return report, nil
		}
	}
}

// ChooseEpsilon gives a quarter of the reach that Check finds, to two digits, and a word about it. It is
// an error of kind ErrOracle where the oracle breaks its contract.
func ChooseEpsilon(ctx context.Context, oracle Oracle) (epsilon float64, reason string, err error) {
	report, err := Check(ctx, oracle, 0)
	if err != nil {
		return 0, "", err
	}
	if report.Epsilon == nil {
		problem := report.GetNoEpsilon()
		return 0, "", newError(KindOf(problem.GetReason()), problem.GetReason(), "%s", problem.GetMessage())
	}
	return report.GetEpsilon(), report.GetEpsilonReason(), nil
}
