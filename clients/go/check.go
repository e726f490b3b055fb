package stellate

import (
	"context"

	pb "stellate/proto/v1"
)

// Check probes an oracle for its contract, before a mesh is made of its answers; what the oracle
// returns as an error is a finding, too. epsilon is what a mesh is planned with, 0: nothing yet. The
// program stellate asks the questions, for clients in all languages alike; doctor.proto says what the
// report has.
func Check(ctx context.Context, oracle Oracle, epsilon float64) (*pb.CheckReport, error) {
	doctor, err := startDoctor()
	if err != nil {
		return nil, err
	}
	defer doctor.Close()
	client, err := NewClient(Connection{Own: doctor})
	if err != nil {
		return nil, err
	}
	defer client.Close()
	info, err := client.Create(ctx, oracle, epsilon, nil)
	if err != nil {
		return nil, err
	}
	_, failure := client.Serve(ctx, oracle, info.GetName(), WorkerOptions{})
	stub := pb.NewDoctorClient(client.connection)
	request := &pb.GetCheckReportRequest{Name: info.GetName()}
	report, err := call(ctx, client.outage(), true, request, stub.GetCheckReport)
	if err != nil && failure != nil {
		return nil, failure // there was no examination
	}
	return report, err
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
